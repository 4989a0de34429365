// Direction of friction: velocity of one dof, or of the three of a ball joint.
#pragma once

#include <tuple>
#include <vector>

#include "constraints/coordinates.hpp"
#include "constraints/row_traits.hpp"

namespace pn {

struct DofSlipRows {
    static constexpr const char* name = "dof_slip";
    static constexpr Role role = Role::direction;
    static constexpr bool constant_A = true, affine_rate = true, comparable_rows = false;
    static constexpr DisplayKind shown = DisplayKind::nothing;

    int dof, count;

    static constexpr auto data() { return std::tuple(Field{"dof", &DofSlipRows::dof}, Field{"count", &DofSlipRows::count}); }
    int size() const { return count; }
    bool is_holonomic(int) const { return false; }
    bool moves_in_time() const { return false; }
    std::vector<int> dofs(const Mechanism&) const {
        std::vector<int> indices;
        for (int k = 0; k < count; ++k) indices.push_back(dof + k);
        return indices;
    }

    template <class State, class Out>
    PN_INLINE void residual(const State&, Out&) const {}
    template <class State, class Out>
    PN_INLINE void rows(const State&, Out& out) const {
        for (int k = 0; k < count; ++k) out.A(k, dof + k) = 1.0;
    }
    template <class State, class Out>
    PN_INLINE void rate_and_bias(const State& s, Out& out) const {
        for (int k = 0; k < count; ++k) out.rate[k] = s.v[dof + k];
    }
};

}  // namespace pn
