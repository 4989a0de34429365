// Direction of friction: sliding of the teeth or threads of a coupling, a weighted sum of the velocities of its joints.
#pragma once

#include <tuple>
#include <vector>

#include "constraints/coordinates.hpp"
#include "constraints/row_traits.hpp"

namespace pn {

struct CouplingSlipRow : SlipDirections {
    static constexpr const char* name = "coupling_slip";
    static constexpr bool constant_A = true;

    int joint1, joint2;
    double weight1, weight2;

    static constexpr auto data() {
        return std::tuple(Field{"joint1", &CouplingSlipRow::joint1}, Field{"joint2", &CouplingSlipRow::joint2},
                          Field{"weight1", &CouplingSlipRow::weight1}, Field{"weight2", &CouplingSlipRow::weight2});
    }
    int size() const { return 1; }
    std::vector<int> dofs(const Mechanism& m) const { return {m.joints[joint1].iv, m.joints[joint2].iv}; }

    template <class State, class Out>
    PN_INLINE void rows(const State& s, Out& out) const {
        out.A(0, s.mechanism.joints[joint1].iv) = weight1;
        out.A(0, s.mechanism.joints[joint2].iv) = weight2;
    }
    template <class State, class Out>
    PN_INLINE void rate_and_bias(const State& s, Out& out) const {
        out.rate[0] = weight1 * s.v[s.mechanism.joints[joint1].iv] + weight2 * s.v[s.mechanism.joints[joint2].iv];
    }
};

}  // namespace pn
