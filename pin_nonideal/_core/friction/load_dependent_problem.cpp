#include "friction/load_dependent_problem.hpp"

#include <algorithm>

#include "dynamics/implicit_friction.hpp"
#include "dynamics/friction_limit.hpp"
#include "math/tolerances.hpp"

namespace pn {

// Rounding error of the limits at the boundary of two zero-load sets, relative to the limits.
constexpr double zero_load_limit_rounding = 1e-10;

static std::vector<int> joined(std::vector<int> list, const std::vector<int>& more) {
    list.insert(list.end(), more.begin(), more.end());
    return list;
}

RestProblem::RestProblem(const Program& program, Workspace& workspace, double time, const VecX& q_, const VecX& v_,
                         const std::vector<int>& resting, const std::vector<int>& slipping)
    : p(program), w(workspace), t(time), q(q_), v(v_), problem_(program, workspace, joined(resting, slipping)) {
    problem_.clean(p, w);
    without_ = w.now.a;
    lam_without_ = w.now.lam;
    equation.n = problem_.rows;
    equation.W = problem_.W;
    problem_.alpha0 = problem_.slip_accelerations(p, w);
    problem_.unload_held(p, w);
    equation.alpha0 = problem_.alpha0;
    for (size_t i = 0; i < problem_.elements.size(); ++i) describe(i, i < resting.size());
    bool by_functions = false;
    each_law<UserLaw>(p.laws, [&](const UserLaw& law) { by_functions |= law.reaction == Reaction::total; });
    for (int e : problem_.elements) {
        const Friction& f = p.frictions[e];
        by_functions |= f.reaction == Reaction::total && f.load == Friction::Load::user;
    }
    if (by_functions)
        equation.evaluate_laws = [this](const VecX& x, VecX& alpha, FrictionLimits& limits) {
            evaluate_laws(x, alpha, limits);
        };
    else collect_loads();
}

double RestProblem::holding_factor(size_t i) const { return friction(i).holding_limit(1.0); }

double RestProblem::sliding_factor(size_t i) const {
    const bool rests = equation.elements[i].may_stick;
    return friction(i).kinetic_limit(1.0, rests ? 0.0 : slip_velocity(w.now, friction(i)).norm());
}

void RestProblem::describe(size_t i, bool resting) {
    const Friction& f = friction(i);
    RestElement e;
    e.dim = f.dim;
    if (i > 0) e.row = equation.elements.back().row + equation.elements.back().dim;
    e.directed = f.gap >= 0 && f.load == Friction::Load::multiplier && shares_contact_loads(p, w);
    const SlipLimits known = f.reaction == Reaction::total ? SlipLimits(f.constant) : w.now.load[problem_.elements[i]];
    e.constant = known.reach();
    e.middle = known.middle();
    const double response = equation.W.diagonal().segment(e.row, e.dim).sum();
    const VecX alpha = equation.alpha0.segment(e.row, e.dim);
    if (response > 0.0) e.rho = e.dim / response;
    if (!resting) {
        e.may_stick = false;
        e.direction = slip_velocity(w.now, f).normalized().eigen().head(f.dim);
    } else if (response == 0.0 && alpha.norm() > 0.0) {  // driven by the constraints
        e.may_stick = false;
        e.direction = alpha.normalized();
    }
    equation.elements.push_back(e);
    equation.elements.back().factor = e.may_stick ? holding_factor(i) : sliding_factor(i);
}

// Compute the loads, which are linear in the motion: loads without friction, and contribution of a unit force of each
// element.
void RestProblem::collect_loads() {
    std::vector<int> load_dependent;
    for (size_t i = 0; i < problem_.elements.size(); ++i) {
        if (friction(i).reaction != Reaction::total || friction(i).load == Friction::Load::none) continue;
        equation.elements[i].vector = 3 * static_cast<int>(load_dependent.size());
        equation.elements[i].vectors = 3;
        load_dependent.push_back(static_cast<int>(i));
    }
    if (load_dependent.empty()) return;
    const int rows = 9 * static_cast<int>(load_dependent.size());
    const auto collect = [&] {
        VecX out(rows);
        w.now.renew();
        for (size_t k = 0; k < load_dependent.size(); ++k) {
            const LoadVectors vectors = load_vectors(p, w, friction(load_dependent[k]));
            for (int j = 0; j < 3; ++j) out.segment<3>(9 * k + 3 * j) = vectors[j].eigen();
        }
        return out;
    };
    const FrozenZeroLoads frozen(p, w);
    move(VecX::Zero(equation.n));
    equation.still = collect();
    equation.loads.resize(rows, equation.n);
    const double size = without_.cwiseAbs().maxCoeff() + p.mechanism.gravity.norm() + 1.0;
    for (size_t i = 0; i < problem_.elements.size(); ++i) {
        for (int k = 0; k < equation.elements[i].dim; ++k) {
            const int column = equation.elements[i].row + k;
            const double most = problem_.response.col(column).cwiseAbs().maxCoeff();
            const double unit = most > 0.0 ? size / most : 1.0;  // its motion is as large as that without friction
            move(unit * VecX::Unit(equation.n, column));
            equation.loads.col(column) = (collect() - equation.still) / unit;
        }
    }
    move(VecX::Zero(equation.n));
}

void RestProblem::move(const VecX& x) {
    w.now.a = without_ + problem_.response * x;
    w.now.lam = lam_without_ + problem_.multipliers * x;
    for (size_t i = 0; i < problem_.elements.size(); ++i) {
        Vec3& force = w.now.slip_force.change(problem_.elements[i]);
        force = Vec3::Zero();
        for (int k = 0; k < equation.elements[i].dim; ++k) force[k] = x[equation.elements[i].row + k];
    }
    w.now.renew();
}

bool RestProblem::is_motion(const VecX& x) {
    if (p.gaps.empty() || equation.loads.rows() == 0) return true;
    move(x);
    VecX alpha;
    FrictionLimits limits;
    equation.respond(x, alpha, limits);
    double off = 0.0, size = limits.size.cwiseAbs().maxCoeff();
    for (size_t i = 0; i < problem_.elements.size(); ++i) {
        if (equation.elements[i].vectors == 0) continue;
        const double limit = equation.elements[i].factor * load_limits(p, w, friction(i), t, q, v).reach();
        off = std::max(off, std::abs(limit - limits[i]));
        size = std::max(size, limit);
    }
    return off <= zero_load_limit_rounding * size;
}

void RestProblem::freeze_zero_loads(const VecX& x) {
    move(x);
    collect_loads();
}

void RestProblem::evaluate_laws(const VecX& x, VecX& alpha, FrictionLimits& limits) {
    VecX C = VecX::Zero(p.mechanism.nv);
    problem_.add_forces(p, w, x, C);
    C = w.now.C_smooth + C;
    solve_with_laws(p, w, t, q, v, C);
    alpha = problem_.slip_accelerations(p, w);
    for (int i = 0; i < equation.n; ++i)
        if (equation.W(i, i) == 0.0) alpha[i] = equation.alpha0[i];
    for (size_t i = 0; i < problem_.elements.size(); ++i) {
        const RestElement& e = equation.elements[i];
        limits.size[i] = e.constant;
        limits.middle[e.row] = e.middle;
        if (friction(i).reaction != Reaction::total) continue;
        const SlipLimits now = load_limits(p, w, friction(i), t, q, v);
        limits.size[i] = now.reach();
        limits.middle[e.row] = now.middle();
    }
}

}  // namespace pn
