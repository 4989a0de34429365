// Kinds of constraints, and of directions along which friction acts.
//
// A kind is one struct in one header. constraints/row_completeness.hpp lists its members. Most kinds act between two
// bodies. A row is then the power of a unit wrench w on the motion of body 1 relative to body 2. So A_j = w . J_j, and
// the multiplier is the size of the wrench. The other kinds act on dofs directly and write A. constraints/block.hpp fills
// A with the rows of a block.
#pragma once

#include <utility>
#include <variant>

#include "constraints/gaps/capsule_capsule.hpp"
#include "constraints/gaps/capsule_capsule_slip.hpp"
#include "constraints/gaps/plane_point.hpp"
#include "constraints/gaps/plane_point_slip.hpp"
#include "constraints/rows/coupling.hpp"
#include "constraints/rows/coupling_slip.hpp"
#include "constraints/rows/distance.hpp"
#include "constraints/rows/dof_slip.hpp"
#include "constraints/gaps/plane_rim_or_ellipsoid.hpp"
#include "constraints/gaps/plane_rim_or_ellipsoid_slip.hpp"
#include "constraints/rows/frame.hpp"
#include "constraints/rows/hinge.hpp"
#include "constraints/rows/hinge_slip.hpp"
#include "constraints/rows/knife_edge.hpp"
#include "constraints/gaps/limit.hpp"
#include "constraints/gaps/capsule_cylinder.hpp"
#include "constraints/gaps/capsule_cylinder_slip.hpp"
#include "constraints/rows/motion.hpp"
#include "constraints/rows/point.hpp"
#include "constraints/gaps/disk_hull.hpp"
#include "constraints/gaps/disk_hull_slip.hpp"
#include "constraints/gaps/cylinder_cylinder.hpp"
#include "constraints/gaps/cylinder_cylinder_slip.hpp"
#include "constraints/rows/rolling.hpp"
#include "constraints/gaps/solid_hull.hpp"
#include "constraints/gaps/solid_hull_slip.hpp"
#include "constraints/rows/spin_slip.hpp"
#include "constraints/rows/user.hpp"
#include "constraints/gaps/user_gap.hpp"
#include "constraints/rows/user_slip.hpp"

namespace pn {

using Kind = std::variant<PointRows, PlanePointRow, CapsuleCapsuleRow, BoxRow, FrameRows, HingeRows, DistanceRows,
                          KnifeEdgeRows, RollingRows, CouplingRows, MotionRows, LimitRow, UserRows, UserGapRow,
                          DofSlipRows, HingeSlipRows, SpinSlipRows, PlanePointSlipRows, CapsuleCapsuleSlipRows,
                          BoxSlipRows, CouplingSlipRow, UserSlipRows, PlaneRimOrEllipsoidRow, PlaneRimOrEllipsoidSlipRows,
                          HullRow, HullSlipRows, RevolvedRow, RevolvedSlipRows, CapsuleCylinderRow,
                          CapsuleCylinderSlipRows, DiskHullRow, DiskHullSlipRows, CylinderCylinderRow,
                          CylinderCylinderSlipRows>;

// Storage that the rows of a constraint need.
struct RowStorage {
    int rows = 0;
    bool geometric = false;  // rows are wrenches between two bodies
    bool constant_A = false;

    RowStorage() = default;
    explicit RowStorage(const Kind& kind);
};

// Values of the rows of one constraint, before any row is removed.
struct RowValues {
    int rows = 0;
    bool geometric = false;  // rows are wrenches between two bodies
    std::vector<Wrench> wrench;
    std::vector<double> bias, residual, rate;
    std::vector<double> phi_t, phi_tt;  // explicit time derivatives of the residual
    MatX A;  // rows x nv, when not geometric
    bool constant_A = false, has_A = false;  // a constant A is written once
    VecX b, scratch;

    void resize(const RowStorage& storage, int nv);
};

// Quantities that the evaluation of a constraint may read.
struct State {
    const Mechanism& mechanism;
    const Terms& terms;
    double t;
    const VecX &q, &v;
};

// Call `f` with the kind if it derives from Base. Return if it does.
template <class Base, class F>
bool visit_as(const Kind& kind, F&& f) {
    return std::visit([&](const auto& k) {
        constexpr bool derives = std::is_base_of_v<Base, std::decay_t<decltype(k)>>;
        if constexpr (derives) f(k);
        return derives;
    }, kind);
}

// Properties of a kind of constraint.
int size(const Kind& kind);
bool is_holonomic(const Kind& kind, int row);
bool moves_in_time(const Kind& kind);
bool has_constant_A(const Kind& kind);
bool has_affine_rate(const Kind& kind);
bool has_comparable_rows(const Kind& kind);
// Return the row with a multiplier that should not be negative, or -1.
int pressing_row(const Kind& kind);
Role role(const Kind& kind);
DisplayKind shown(const Kind& kind);
// Return both frames of a constraint between bodies, or null pointers for other constraints.
std::pair<const Frame*, const Frame*> frames(const Kind& kind);
// Return the functions of time among the data of a constraint.
std::vector<const TimeFunction*> time_functions(const Kind& kind);
// Return the dofs on which A may differ from zero.
std::vector<int> dofs(const Kind& kind, const Mechanism& m);

// Parts of the evaluation of all rows of a constraint: `residual` for the residuals alone, `place` for residuals and
// wrenches or A of placed bodies, and `motion` for rates and biases. `motion` needs velocities of the bodies, and the part
// `place` in advance.
enum class Part { residual, place, motion };
void evaluate(const Kind& kind, const State& s, Part part, RowValues& out);

}  // namespace pn
