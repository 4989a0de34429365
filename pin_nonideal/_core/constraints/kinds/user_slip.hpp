// Direction of friction as the user's function gives it.
#pragma once

#include <functional>
#include <tuple>
#include <vector>

#include "constraints/coordinates.hpp"
#include "constraints/kinds/facts.hpp"
#include "tree/liegroup.hpp"

namespace pn {

// Difference in time by which the direction's own rate is taken: rounding and the second derivative share the error.
constexpr double direction_step = 1e-6;

struct UserSlipRow {
    static constexpr const char* name = "user_slip";
    static constexpr Role role = Role::direction;
    static constexpr bool constant_A = false, affine_rate = true, comparable_rows = false;
    static constexpr Shown shown = Shown::nothing;

    std::function<void(double t, const VecX& q, VecX& row)> direction;

    static constexpr auto data() { return std::tuple(Datum{"direction", &UserSlipRow::direction}); }
    int size() const { return 1; }
    bool is_holonomic(int) const { return false; }
    bool moves_in_time() const { return true; }
    std::vector<int> dofs(const Mechanism& m) const { return all_dofs(m); }

    template <class State, class Out>
    PN_INLINE void residual(const State&, Out&) const {}
    template <class State, class Out>
    PN_INLINE void rows(const State& s, Out& out) const {
        direction(s.t, s.q, out.scratch);
        out.A.row(0) = out.scratch.transpose();
    }
    // The drift is d(n(t, q))/dt . v, by a difference along the motion.
    template <class State, class Out>
    PN_INLINE void rate_and_drift(const State& s, Out& out) const {
        out.rate[0] = out.A.row(0).dot(s.v);
        const double h = direction_step;
        VecX ahead(s.q.size()), row(s.v.size());
        const VecX step = h * s.v, back = -step;
        retract(s.mechanism, s.q.data(), step.data(), ahead.data());
        direction(s.t + h, ahead, row);
        const double forward = row.dot(s.v);
        retract(s.mechanism, s.q.data(), back.data(), ahead.data());
        direction(s.t - h, ahead, row);
        out.drift[0] = (forward - row.dot(s.v)) / (2.0 * h);
    }
};

}  // namespace pn
