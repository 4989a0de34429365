// Rows A a = b from the user's functions.
#pragma once

#include <functional>
#include <tuple>
#include <vector>

#include "constraints/coordinates.hpp"
#include "constraints/row_traits.hpp"

namespace pn {

struct UserRows : ConstraintKind {
    static constexpr const char* name = "user";
    // A may depend on v. The rate is then not A v + phi_t.
    static constexpr bool affine_rate = false;
    static constexpr DisplayKind shown = DisplayKind::nothing;

    int count = 0;
    std::function<void(double t, const VecX& q, const VecX& v, MatX& A, VecX& b)> function;
    std::function<void(double t, const VecX& q, VecX& phi)> residual_function;                // may be empty
    std::function<void(double t, const VecX& q, const VecX& v, VecX& rate)> rate_function;    // may be empty

    static constexpr auto data() {
        return std::tuple(Field{"size", &UserRows::count}, Field{"rows", &UserRows::function},
                          Field{"residual", &UserRows::residual_function}, Field{"rate", &UserRows::rate_function});
    }
    int size() const { return count; }
    bool is_holonomic(int) const { return static_cast<bool>(residual_function); }
    bool moves_in_time() const { return true; }
    std::vector<int> dofs(const Mechanism& m) const { return all_dofs(m); }

    template <class State, class Out>
    PN_INLINE void residual(const State& s, Out& out) const {
        if (!residual_function) return;
        residual_function(s.t, s.q, out.scratch);
        for (int k = 0; k < count; ++k) out.residual[k] = out.scratch[k];
    }
    // The user's function computes A and b together.
    template <class State, class Out>
    PN_INLINE void rows(const State& s, Out& out) const {
        function(s.t, s.q, s.v, out.A, out.b);
        for (int k = 0; k < count; ++k) out.bias[k] = -out.b[k];
    }
    template <class State, class Out>
    PN_INLINE void rate_and_bias(const State& s, Out& out) const {
        if (!rate_function) return;
        rate_function(s.t, s.q, s.v, out.scratch);
        for (int k = 0; k < count; ++k) out.rate[k] = out.scratch[k];
    }
};

}  // namespace pn
