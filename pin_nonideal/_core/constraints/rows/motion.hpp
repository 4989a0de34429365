// q_joint = f(t): a prescribed motion.
#pragma once

#include <tuple>
#include <vector>

#include "constraints/coordinates.hpp"
#include "constraints/row_traits.hpp"
#include "math/time_function.hpp"

namespace pn {

struct MotionRows : ConstraintKind {
    static constexpr const char* name = "motion";
    static constexpr bool constant_A = true, affine_rate = true;
    static constexpr DisplayKind shown = DisplayKind::drive;

    int joint;
    TimeFunction function;
    double period;  // period of the residual for an unbounded joint (0: none)

    static constexpr auto data() {
        return std::tuple(Field{"joint", &MotionRows::joint}, Field{"function", &MotionRows::function},
                          Field{"period", &MotionRows::period});
    }
    int size() const { return 1; }
    bool is_holonomic(int) const { return true; }
    bool moves_in_time() const { return true; }
    std::vector<int> dofs(const Mechanism& m) const { return {m.joints[joint].iv}; }

    template <class State, class Out>
    PN_INLINE void residual(const State& s, Out& out) const {
        const Jet f = evaluate(function, s.t);
        out.residual[0] = wrap(joint_angle(s.mechanism.joints[joint], s.q) - f[0], period);  // Eq. (2)
        out.phi_t[0] = -f[1];
        out.phi_tt[0] = -f[2];
    }
    template <class State, class Out>
    PN_INLINE void rows(const State& s, Out& out) const {
        out.A(0, s.mechanism.joints[joint].iv) = 1.0;
    }
    template <class State, class Out>
    PN_INLINE void rate_and_bias(const State& s, Out& out) const {
        out.rate[0] = s.v[s.mechanism.joints[joint].iv] + out.phi_t[0];
        out.bias[0] = out.phi_tt[0];
    }
};

}  // namespace pn
