#include "friction/slip_onset.hpp"

#include <algorithm>

#include "complementarity/socp_mode_newton.hpp"
#include "complementarity/load_dependent/solver.hpp"
#include "math/tolerances.hpp"

namespace pn {

namespace {

struct Onset {
    VecX force, slip;            // along its directions: force relative to the middle of its limits, slip direction at onset
    bool slides, has_direction;  // acceleration above rounding, slip direction known
    bool breaks;                 // was sticking until now and is at its limit
};

bool breaks(const ModeQuery& query, int e, const VecX& force, double limit) {
    const std::vector<int>& list = query.at_limit;
    return force.norm() >= limit * (1.0 - slip_onset_parameters.condition_slack) &&
           std::find(list.begin(), list.end(), e) != list.end();
}

std::vector<Mode> modes_of(Workspace& w, const ModeQuery& query, const std::vector<Onset>& all) {
    std::vector<Mode> modes = query.modes;
    const bool any_direction = std::any_of(all.begin(), all.end(), [](const Onset& one) { return one.has_direction; });
    for (size_t i = 0; i < all.size(); ++i) {
        const int e = query.at_rest[i];
        const Onset& one = all[i];
        modes[e] = sticking;
        // Some of the elements that reach their limits together may keep sticking.
        if (!one.slides && !(one.breaks && (one.has_direction || !any_direction))) continue;
        const VecX direction = one.has_direction ? VecX(one.slip.normalized()) : VecX(-one.force.normalized());
        Vec3 along;
        for (int k = 0; k < direction.size(); ++k) along[k] = direction[k];
        if (direction.size() > 1) w.state.slip_direction[e] = w.state.last_direction[e] = along;
        modes[e] = direction.size() > 1 || along[0] > 0.0 ? slip_plus : slip_minus;
    }
    return modes;
}

}  // namespace

bool any_breaks(const ModeQuery& query, const RestEquation& equation, const VecX& x) {
    VecX alpha;
    FrictionLimits limits;
    equation.respond(x, alpha, limits);
    for (size_t i = 0; i < query.at_rest.size(); ++i) {
        const RestElement& e = equation.elements[i];
        const VecX force = x.segment(e.row, e.dim) - limits.middle.segment(e.row, e.dim);
        if (breaks(query, query.at_rest[i], force, limits[i])) return true;
    }
    return false;
}

// Friction and acceleration of a slipping element are opposite. The larger one, relative to its rounding, gives the
// slip direction.
std::vector<Mode> modes_of(Workspace& w, const ModeQuery& query, const FrictionProblem& problem, const VecX& f,
                           const FrictionLimits& limits) {
    const VecX alpha = problem.alpha0 + problem.W * f, from_middle = f - limits.middle;
    const double noise = relative_acceleration_rounding * problem.alpha0.cwiseAbs().maxCoeff();
    const double min_onset = slip_onset_parameters.max_acceleration * problem.alpha0.cwiseAbs().maxCoeff();
    std::vector<Onset> all;
    VecX onset;
    for (size_t i = 0, row = 0; i < query.at_rest.size(); row += problem.dims[i], ++i) {
        const int dim = problem.dims[i];
        const VecX force = from_middle.segment(row, dim), slip = alpha.segment(row, dim);
        const bool broken = breaks(query, query.at_rest[i], force, limits[i]);
        const bool slides =
            force.norm() >= limits[i] * (1.0 - slip_onset_parameters.limit_rounding) && slip.norm() > noise;
        const bool is_slow =
            dim > 1 ? force.norm() >= limits[i] * (1.0 - slip_onset_parameters.condition_slack) && slip.norm() < min_onset
                    : broken && !slides;
        if (is_slow && onset.size() == 0)
            onset = onset_accelerations(problem.W, problem.alpha0, problem.dims, limits);
        const double response = problem.W.diagonal().segment(row, dim).sum() / dim;
        const bool by_force = slides && force.norm() * response > slip.norm();
        const VecX begins = is_slow ? VecX(onset.segment(row, dim)) : by_force ? VecX(-force) : slip;
        all.push_back({force, begins, slides, (slides || is_slow) && begins.norm() > noise, broken});
    }
    return modes_of(w, query, all);
}

std::vector<Mode> modes_of(Workspace& w, const ModeQuery& query, const RestEquation& equation, const VecX& x) {
    VecX alpha, onset;
    FrictionLimits limits;
    equation.respond(x, alpha, limits);
    const VecX from_middle = x - limits.middle;
    const double noise = relative_acceleration_rounding + slip_onset_parameters.residual_to_acceleration * equation.error(x);
    std::vector<Onset> all;
    for (size_t i = 0; i < query.at_rest.size(); ++i) {
        const RestElement& e = equation.elements[i];
        const VecX force = from_middle.segment(e.row, e.dim), slip = alpha.segment(e.row, e.dim);
        const bool broken = breaks(query, query.at_rest[i], force, limits[i]);
        const bool at_its_limit =
            force.norm() >= limits[i] * (1.0 - slip_onset_parameters.limit_rounding) ||
            (force - e.rho * slip).norm() > limits[i] * (1.0 + slip_onset_parameters.limit_rounding);
        const double acceleration_scale = equation.force_scale(i, x, limits);
        const bool slides = !e.may_stick || (at_its_limit && e.rho * slip.norm() > noise * acceleration_scale);
        const bool is_slow = broken && !slides;
        if (is_slow && onset.size() == 0) onset = onset_accelerations(equation, x);
        const bool by_force = slides && e.may_stick && force.norm() > e.rho * slip.norm();
        const VecX begins = is_slow ? VecX(onset.segment(e.row, e.dim)) : by_force ? VecX(-force) : slip;
        const bool accelerates = e.rho * begins.norm() > relative_acceleration_rounding * acceleration_scale;
        const bool has_direction = slides || (is_slow && accelerates);
        all.push_back({force, begins, slides, has_direction, broken});
    }
    return modes_of(w, query, all);
}

}  // namespace pn
