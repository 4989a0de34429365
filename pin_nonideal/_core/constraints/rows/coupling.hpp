// Coupling of two joints, such as gears and belts: q1 = ratio q2 + offset.
#pragma once

#include <tuple>
#include <vector>

#include "constraints/coordinates.hpp"
#include "constraints/row_traits.hpp"

namespace pn {

struct CouplingRows : ConstraintKind {
    static constexpr const char* name = "coupling";
    static constexpr bool constant_A = true, affine_rate = true;
    static constexpr DisplayKind shown = DisplayKind::gear;

    int joint1, joint2;
    double ratio, offset, period;  // period of the residual for unbounded joints (0: none)
    bool position;                 // false: no angle determines the residual, and only the rate is constrained

    static constexpr auto data() {
        return std::tuple(Field{"joint1", &CouplingRows::joint1}, Field{"joint2", &CouplingRows::joint2},
                          Field{"ratio", &CouplingRows::ratio}, Field{"offset", &CouplingRows::offset},
                          Field{"period", &CouplingRows::period}, Field{"position", &CouplingRows::position});
    }
    int size() const { return 1; }
    bool is_holonomic(int) const { return true; }
    bool moves_in_time() const { return false; }
    std::vector<int> dofs(const Mechanism& m) const { return {m.joints[joint1].iv, m.joints[joint2].iv}; }

    template <class State, class Out>
    PN_INLINE void residual(const State& s, Out& out) const {
        const Joint &j1 = s.mechanism.joints[joint1], &j2 = s.mechanism.joints[joint2];
        const auto gap = joint_angle(j1, s.q) - ratio * joint_angle(j2, s.q) - offset;  // Eq. (2)
        if (position) out.residual[0] = wrap(gap, period);
    }
    template <class State, class Out>
    PN_INLINE void rows(const State& s, Out& out) const {
        out.A(0, s.mechanism.joints[joint1].iv) = 1.0;
        out.A(0, s.mechanism.joints[joint2].iv) = -ratio;
    }
    template <class State, class Out>
    PN_INLINE void rate_and_bias(const State& s, Out& out) const {
        out.rate[0] = s.v[s.mechanism.joints[joint1].iv] - ratio * s.v[s.mechanism.joints[joint2].iv];
    }
};

}  // namespace pn
