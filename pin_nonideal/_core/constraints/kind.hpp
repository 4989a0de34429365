// The kinds of constraints, and of directions along which friction acts.
//
// A kind is one struct in one header that knows everything about itself; is_complete below lists what. Most kinds act
// between two bodies: a row is then the power of a unit wrench w on the motion of body 1 relative to body 2, so that
// A_j = w . J_j, and the multiplier is the size of that wrench. The others act on dofs directly and write A.
#pragma once

#include <string>
#include <type_traits>
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

template <class K, class = void>
constexpr bool is_geometric = false;
template <class K>
constexpr bool is_geometric<K, std::void_t<decltype(&K::frame1), decltype(&K::frame2)>> = true;

// Whether K answers a question: a lambda that asks it.
template <class K, class Question>
constexpr bool answers(Question) { return std::is_invocable_v<Question, const K&>; }
// Its constants as types, so that a question can ask for them.
template <class K> using ConstantA = std::bool_constant<std::decay_t<K>::constant_A>;
template <class K> using AffineRate = std::bool_constant<std::decay_t<K>::affine_rate>;
template <class K> using ComparableRows = std::bool_constant<std::decay_t<K>::comparable_rows>;
template <class K> using ShownAs = std::integral_constant<Shown, std::decay_t<K>::shown>;
template <class K> using Called = decltype(std::string(std::decay_t<K>::name));
template <class K> using RoleOf = std::integral_constant<Role, std::decay_t<K>::role>;
// Something of a type, in questions that nobody asks.
template <class T> T given();

// A struct is a kind when it says all this of itself.
template <class K>
constexpr bool is_complete() {
    using At = std::conditional_t<is_geometric<K>, const Sides<Pose>&, const State&>;
    static_assert(answers<K>([](const auto& k) -> Called<decltype(k)> { return {}; }),
                  "a kind needs `static constexpr const char* name`: by which Python adds it");
    static_assert(answers<K>([](const auto& k) -> RoleOf<decltype(k)> { return {}; }),
                  "a kind needs `static constexpr Role role`: a constraint, a contact or a direction of friction");
    static_assert(answers<K>([](const auto& k) -> decltype(k.data(), void()) {}),
                  "a kind needs `static constexpr auto data()`: what it is made of, by name");
    static_assert(answers<K>([](const auto& k) -> decltype(int(k.size())) { return 0; }),
                  "a kind needs `int size() const`: its number of rows");
    static_assert(answers<K>([](const auto& k) -> decltype(bool(k.is_holonomic(0))) { return true; }),
                  "a kind needs `bool is_holonomic(int row) const`: whether a position stands behind the row");
    static_assert(answers<K>([](const auto& k) -> decltype(bool(k.moves_in_time())) { return true; }),
                  "a kind needs `bool moves_in_time() const`: whether its rate may differ from zero at rest");
    static_assert(is_geometric<K> ||
                      answers<K>([](const auto& k) -> decltype(k.dofs(given<const Mechanism&>())) { return {}; }),
                  "a kind needs `Frame frame1, frame2`, or `std::vector<int> dofs(const Mechanism&) const`");
    static_assert(answers<K>([](const auto& k) -> ConstantA<decltype(k)> { return {}; }),
                  "a kind needs `static constexpr bool constant_A`: whether A never changes");
    static_assert(answers<K>([](const auto& k) -> AffineRate<decltype(k)> { return {}; }),
                  "a kind needs `static constexpr bool affine_rate`: whether its rate is A(q, t) v + phi_t");
    static_assert(answers<K>([](const auto& k) -> ComparableRows<decltype(k)> { return {}; }),
                  "a kind needs `static constexpr bool comparable_rows`: components of one vector");
    static_assert(answers<K>([](const auto& k) -> ShownAs<decltype(k)> { return {}; }),
                  "a kind needs `static constexpr Shown shown`: what a replay shows of it");
    static_assert(answers<K>([](const auto& k) -> decltype(k.residual(given<At>(), given<RowValues&>())) {}),
                  "a kind needs `residual`: phi(q, t) of each row, with phi_t and phi_tt where it moves");
    static_assert(answers<K>([](const auto& k) -> decltype(k.rows(given<At>(), given<RowValues&>())) {}),
                  "a kind needs `rows`: unit wrenches, or A itself");
    static_assert(answers<K>([](const auto& k) -> decltype(k.rate_and_drift(given<At>(), given<RowValues&>())) {}),
                  "a kind needs `rate_and_drift`: A v + phi_t, and its rate at zero acceleration");
    return true;
}

template <class... K>
constexpr bool all_complete(const std::variant<K...>*) { return (is_complete<K>() && ...); }
static_assert(all_complete(static_cast<const Kind*>(nullptr)));

// What a kind knows of itself, whichever it is.
inline int size(const Kind& kind) {
    return std::visit([](const auto& k) { return k.size(); }, kind);
}
inline bool is_holonomic(const Kind& kind, int row) {
    return std::visit([row](const auto& k) { return k.is_holonomic(row); }, kind);
}
inline bool moves_in_time(const Kind& kind) {
    return std::visit([](const auto& k) { return k.moves_in_time(); }, kind);
}
inline bool has_constant_A(const Kind& kind) {
    return std::visit([](const auto& k) { return k.constant_A; }, kind);
}
inline bool has_affine_rate(const Kind& kind) {
    return std::visit([](const auto& k) { return k.affine_rate; }, kind);
}
inline bool has_comparable_rows(const Kind& kind) {
    return std::visit([](const auto& k) { return k.comparable_rows; }, kind);
}
// The row whose multiplier should press, or -1.
inline int pressing_row(const Kind& kind) {
    return std::visit([](const auto& k) {
        if constexpr (answers<std::decay_t<decltype(k)>>([](const auto& own) -> decltype(own.pressing) { return {}; }))
            return k.pressing;
        else
            return -1;
    }, kind);
}
inline Shown shown(const Kind& kind) {
    return std::visit([](const auto& k) { return k.shown; }, kind);
}
// Its two frames, where it acts between bodies; else none.
inline std::pair<const Frame*, const Frame*> frames(const Kind& kind) {
    return std::visit([](const auto& k) -> std::pair<const Frame*, const Frame*> {
        if constexpr (is_geometric<std::decay_t<decltype(k)>>) return {&k.frame1, &k.frame2};
        else return {nullptr, nullptr};
    }, kind);
}
// Dofs on which A may differ from zero.
inline std::vector<int> dofs(const Kind& kind, const Mechanism& m) {
    return std::visit([&m](const auto& k) {
        if constexpr (is_geometric<std::decay_t<decltype(k)>>) {
            std::vector<int> both = m.dofs_of(k.frame1.joint);
            for (int d : m.dofs_of(k.frame2.joint)) both.push_back(d);
            return both;
        } else {
            return k.dofs(m);
        }
    }, kind);
}

// What of all rows of the kind is evaluated: the residuals alone; residuals and wrenches or A, which bodies in their
// places give; or rates and drifts, which need bodies in motion, and the place part before.
enum class Part { residual, place, motion };
void evaluate(const Kind& kind, const State& s, Part part, RowValues& out);

}  // namespace pn
