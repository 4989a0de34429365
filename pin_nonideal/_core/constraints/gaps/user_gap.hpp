// A gap from the user's functions.
#pragma once

#include "constraints/rows/user.hpp"

namespace pn {

struct UserGapRow : GapKind {
    static constexpr const char* name = "user_gap";
    static constexpr DisplayKind shown = DisplayKind::nothing;

    decltype(UserRows::function) function;
    decltype(UserRows::residual_function) gap;
    decltype(UserRows::rate_function) gap_rate;

    static constexpr auto data() {
        return std::tuple(Field{"rows", &UserGapRow::function}, Field{"gap", &UserGapRow::gap},
                          Field{"rate", &UserGapRow::gap_rate});
    }
    bool moves_in_time() const { return true; }
    std::vector<int> dofs(const Mechanism& m) const { return all_dofs(m); }

    template <class State, class Out>
    PN_INLINE void residual(const State& s, Out& out) const {
        gap(s.t, s.q, out.scratch);
        out.residual[0] = out.scratch[0];  // Eq. (2)
    }
    // The user's function computes A and b together.
    template <class State, class Out>
    PN_INLINE void rows(const State& s, Out& out) const {
        function(s.t, s.q, s.v, out.A, out.b);
        out.bias[0] = -out.b[0];
    }
    template <class State, class Out>
    PN_INLINE void rate_and_bias(const State& s, Out& out) const {
        gap_rate(s.t, s.q, s.v, out.scratch);
        out.rate[0] = out.scratch[0];
    }
};

}  // namespace pn
