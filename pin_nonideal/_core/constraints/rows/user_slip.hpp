// Directions of friction from the user's function.
#pragma once

#include <functional>
#include <tuple>
#include <vector>

#include "constraints/coordinates.hpp"
#include "constraints/row_traits.hpp"
#include "tree/lie_group.hpp"

namespace pn {

// Time difference [s] for the rates of the directions. This difference balances rounding against the truncation error.
constexpr double direction_step = 1e-6;

struct UserSlipRows : SlipDirections {
    static constexpr const char* name = "user_slip";

    int count = 1;
    std::function<void(double t, const VecX& q, VecX& rows)> directions;  // in sequence

    static constexpr auto data() {
        return std::tuple(Field{"size", &UserSlipRows::count}, Field{"directions", &UserSlipRows::directions});
    }
    int size() const { return count; }
    bool moves_in_time() const { return true; }
    std::vector<int> dofs(const Mechanism& m) const { return all_dofs(m); }

    template <class State, class Out>
    PN_INLINE void rows(const State& s, Out& out) const {
        directions(s.t, s.q, out.scratch);
        for (int k = 0; k < count; ++k) out.A.row(k) = out.scratch.segment(k * s.v.size(), s.v.size()).transpose();
    }
    // Compute the bias d(n(t, q))/dt . v by a central difference along the motion.
    template <class State, class Out>
    PN_INLINE void rate_and_bias(const State& s, Out& out) const {
        const double h = direction_step;
        const auto nv = s.v.size();
        VecX ahead(s.q.size()), before(count * nv), after(count * nv);
        const VecX step = h * s.v, back = -step;
        retract(s.mechanism, s.q.data(), step.data(), ahead.data());
        directions(s.t + h, ahead, after);
        retract(s.mechanism, s.q.data(), back.data(), ahead.data());
        directions(s.t - h, ahead, before);
        for (int k = 0; k < count; ++k) {
            out.rate[k] = out.A.row(k).dot(s.v);
            out.bias[k] = (after.segment(k * nv, nv).dot(s.v) - before.segment(k * nv, nv).dot(s.v)) / (2.0 * h);
        }
    }
};

}  // namespace pn
