// A joint stays within its stop: sign (q - bound) stays nonnegative.
#pragma once

#include <tuple>
#include <vector>

#include "constraints/coordinates.hpp"
#include "constraints/row_traits.hpp"

namespace pn {

struct LimitRow : GapKind {
    static constexpr const char* name = "limit";
    static constexpr bool constant_A = true;
    static constexpr DisplayKind shown = DisplayKind::nothing;

    int joint;
    double bound, sign;  // sign: +1 for a lower stop, -1 for an upper one

    static constexpr auto data() {
        return std::tuple(Field{"joint", &LimitRow::joint}, Field{"bound", &LimitRow::bound},
                          Field{"sign", &LimitRow::sign});
    }
    std::vector<int> dofs(const Mechanism& m) const { return {m.joints[joint].iv}; }

    template <class State, class Out>
    PN_INLINE void residual(const State& s, Out& out) const {
        out.residual[0] = sign * (joint_angle(s.mechanism.joints[joint], s.q) - bound);  // Eq. (2)
    }
    template <class State, class Out>
    PN_INLINE void rows(const State& s, Out& out) const {
        out.A(0, s.mechanism.joints[joint].iv) = sign;
    }
    template <class State, class Out>
    PN_INLINE void rate_and_bias(const State& s, Out& out) const {
        out.rate[0] = sign * s.v[s.mechanism.joints[joint].iv];
    }
};

}  // namespace pn
