// The kinds of constraints, and of directions along which friction acts.
//
// A kind is one struct in one header that knows everything about itself; constraints/kinds/complete.hpp lists what. Most
// kinds act between two bodies: a row is then the power of a unit wrench w on the motion of body 1 relative to body 2, so
// that A_j = w . J_j, and the multiplier is the size of that wrench. The others act on dofs directly and write A.
#pragma once

#include <utility>
#include <variant>

#include "constraints/kinds/box.hpp"
#include "constraints/kinds/box_slip.hpp"
#include "constraints/kinds/capsules.hpp"
#include "constraints/kinds/capsules_slip.hpp"
#include "constraints/kinds/contact.hpp"
#include "constraints/kinds/contact_slip.hpp"
#include "constraints/kinds/coupling.hpp"
#include "constraints/kinds/coupling_slip.hpp"
#include "constraints/kinds/distance.hpp"
#include "constraints/kinds/dof_slip.hpp"
#include "constraints/kinds/ellipsoid.hpp"
#include "constraints/kinds/ellipsoid_slip.hpp"
#include "constraints/kinds/frame.hpp"
#include "constraints/kinds/hinge.hpp"
#include "constraints/kinds/hinge_slip.hpp"
#include "constraints/kinds/knife.hpp"
#include "constraints/kinds/limit.hpp"
#include "constraints/kinds/line.hpp"
#include "constraints/kinds/line_slip.hpp"
#include "constraints/kinds/motion.hpp"
#include "constraints/kinds/point.hpp"
#include "constraints/kinds/rim.hpp"
#include "constraints/kinds/rim_slip.hpp"
#include "constraints/kinds/rims.hpp"
#include "constraints/kinds/rims_slip.hpp"
#include "constraints/kinds/rolling.hpp"
#include "constraints/kinds/solid.hpp"
#include "constraints/kinds/solid_slip.hpp"
#include "constraints/kinds/turn_slip.hpp"
#include "constraints/kinds/user.hpp"
#include "constraints/kinds/user_gap.hpp"
#include "constraints/kinds/user_slip.hpp"

namespace pn {

using Kind = std::variant<PointRows, ContactRow, CapsulesRow, BoxRow, FrameRows, HingeRows, DistanceRows, KnifeRows,
                          RollingRows, CouplingRows, MotionRows, LimitRow, UserRows, UserGapRow, DofRows,
                          HingeSlipRows, TurnSlipRows, ContactSlipRows, CapsulesSlipRows, BoxSlipRows, CouplingSlipRow,
                          UserSlipRows, EllipsoidRow, EllipsoidSlipRows, HullRow, HullSlipRows, RevolvedRow,
                          RevolvedSlipRows, LineRow, LineSlipRows, RimRow, RimSlipRows, RimsRow,
                          RimsSlipRows>;

// Rows of one constraint before any is left out.
struct RowValues {
    int rows = 0;
    bool geometric = false;  // rows are wrenches between two bodies
    std::vector<Wrench> wrench;
    std::vector<double> drift, residual, rate;
    std::vector<double> phi_t, phi_tt;  // explicit rates in time of the residual
    MatX A;  // rows x nv, when not geometric
    bool constant_A = false, has_A = false;  // A that never changes is written once
    VecX b, scratch;

    void resize(const Kind& kind, int nv);
};

// What an evaluation of a kind may read.
struct State {
    const Mechanism& mechanism;
    const Terms& terms;
    double t;
    const VecX &q, &v;
};

// What a kind knows of itself, whichever it is.
int size(const Kind& kind);
bool is_holonomic(const Kind& kind, int row);
bool moves_in_time(const Kind& kind);
bool has_constant_A(const Kind& kind);
bool has_affine_rate(const Kind& kind);
bool has_comparable_rows(const Kind& kind);
// The row whose multiplier should press, or -1.
int pressing_row(const Kind& kind);
Role role(const Kind& kind);
Shown shown(const Kind& kind);
// Its two frames, where it acts between bodies; else none.
std::pair<const Frame*, const Frame*> frames(const Kind& kind);
// The functions of time that move it.
std::vector<const TimeFunction*> time_functions(const Kind& kind);
// Dofs on which A may differ from zero.
std::vector<int> dofs(const Kind& kind, const Mechanism& m);

// What of all rows of the kind is evaluated: the residuals alone; residuals and wrenches or A, which bodies in their
// places give; or rates and drifts, which need bodies in motion, and the place part before.
enum class Part { residual, place, motion };
void evaluate(const Kind& kind, const State& s, Part part, RowValues& out);

}  // namespace pn
