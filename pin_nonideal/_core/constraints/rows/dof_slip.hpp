// Direction of friction: velocity of one dof, or of the three of a ball joint.
#pragma once

#include <tuple>
#include <vector>

#include "constraints/coordinates.hpp"
#include "constraints/row_traits.hpp"

namespace pn {

struct DofSlipRows : SlipDirections {
    static constexpr const char* name = "dof_slip";
    static constexpr bool constant_A = true;

    int dof, count;

    static constexpr auto data() { return std::tuple(Field{"dof", &DofSlipRows::dof}, Field{"count", &DofSlipRows::count}); }
    int size() const { return count; }
    std::vector<int> dofs(const Mechanism&) const {
        std::vector<int> indices;
        for (int k = 0; k < count; ++k) indices.push_back(dof + k);
        return indices;
    }

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
