#include "dynamics/law_residuals.hpp"

#include <algorithm>
#include <cmath>

#include "constraints/redundancy.hpp"
#include "dynamics/acceleration.hpp"
#include "dynamics/evaluation.hpp"
#include "dynamics/friction_limit.hpp"
#include "dynamics/law_forces.hpp"
#include "dynamics/reactions.hpp"
#include "dynamics/reported_loads.hpp"
#include "math/tolerances.hpp"
#include "tree/mass_factor.hpp"

namespace pn {

namespace {

// Friction of a loaded element: force of its law, or multiplier of its rows.
Vec3 friction_by_row(const Program& p, Workspace& w, int e, const VecX& lam) {
    const Block& block = p.blocks[p.frictions[e].block];
    if (w.state.mode[e] != sticking) return w.now.slip_force[e];
    if (is_locked(w, block)) return friction_force(p, w, e);
    Vec3 force = Vec3::Zero();
    for (size_t k = 0; k < block.kept.size(); ++k) force[k] = lam[block.row + k];
    return force;
}

// Residuals of the laws of one motion. `weight` is 1 / sqrt(M_ii), and `scale` the largest force.
struct Laws {
    const Program& p;
    Workspace& w;
    const VecX& v;
    const VecX& a;
    const MotionForces& forces;
    const MotionState& state;
    VecX &weight, &left, &magnitude;
    double scale = law_residual_parameters.min_force, slip_error = 0.0;
    LawResiduals out;

    void weigh() {
        const Mechanism& m = p.mechanism;
        for (int i = 0; i < m.nv; ++i)
            weight[i] = 1.0 / std::sqrt(m.is_deep[i] ? w.now.terms.D[i] : w.now.terms.M[m.row_offset[i]]);
    }

    void subtract(int dof, double force) {
        left[dof] -= force;
        magnitude[dof] += std::abs(force);
    }

    // Subtract forces f along the rows of a block.
    void subtract_along(const Block& block, const double* f) {
        if (block.dof >= 0) {
            for (int k = 0; k < block.total; ++k) subtract(block.dof + k, f[k]);
            return;
        }
        const size_t n = block.kept.size();
        const double* A = w.now.A.data() + block.offset;
        for (size_t l = 0; l < block.support().size(); ++l)
            for (size_t k = 0; k < n; ++k) subtract(block.support()[l], *A++ * f[k]);
    }

    void check_motion() {
        multiply_M(p.mechanism, w.now.terms, a, left);  // M a + nle - tau - C - A^T lam, Eq. (4)
        magnitude = left.cwiseAbs() + forces.magnitude;
        left -= forces.given;
        for (int i : w.now.rows.blocks)
            if (i < p.constraints) subtract_along(p.blocks[i], forces.lam.data() + p.blocks[i].row);
        for (int e : w.now.loaded_elements) {
            const Vec3& f = forces.friction[e];
            const double along[3] = {f[0], f[1], f[2]};
            subtract_along(p.blocks[p.frictions[e].block], along);
        }
        for (int i = 0; i < p.mechanism.nv; ++i) scale = std::max(scale, weight[i] * magnitude[i]);
        for (int e : w.now.loaded_elements)
            scale = std::max(scale, forces.limits[e].reach() * length(p.blocks[p.frictions[e].block]));
        for (int i = 0; i < p.mechanism.nv; ++i) out.motion.include(weight[i] * std::abs(left[i]) / scale, i);
    }

    // Length of the longest row of a block.
    double length(const Block& block) const {
        double longest = 0.0;
        if (block.dof >= 0) {
            for (int k = 0; k < block.total; ++k) longest = std::max(longest, weight[block.dof + k]);
            return longest;
        }
        const size_t n = block.kept.size();
        const double* A = w.now.A.data() + block.offset;
        for (size_t l = 0; l < block.support().size(); ++l)
            for (size_t k = 0; k < n; ++k) longest = std::max(longest, weight[block.support()[l]] * std::abs(*A++));
        return longest;
    }

    // Check if a row depends on others. The start of a step has checked its acceleration.
    bool depends(int row) const { return w.now.rows.required[row] && !w.now.rows.active[row]; }

    // min(N, gap acceleration) = 0, the same as N >= 0, gap acceleration >= 0 and N * gap acceleration = 0.
    void check_gap(int gap) {
        const Block& block = p.blocks[p.gaps[gap].block];
        if (block.kept.empty()) return;
        const double size = length(block);
        if (!(size > 0.0)) return;
        double acceleration = w.now.values[p.gaps[gap].block].bias[block.kept[0]];
        const double* A = w.now.A.data() + block.offset;
        for (size_t l = 0; l < block.support().size(); ++l) acceleration += A[l] * a[block.support()[l]];
        if (depends(block.row)) acceleration = 0.0;
        const double load = w.state.closed[gap] ? forces.shared_lam[block.row] : 0.0;
        out.signorini.include(std::abs(std::min(load * size, acceleration / size)) / scale, p.gaps[gap].block);
    }

    Vec3 slip_acceleration_of(const Friction& f) {
        const Block& block = p.blocks[f.block];
        Vec3 rate = Vec3::Zero();
        if (block.dof >= 0) {
            for (int k = 0; k < f.dim; ++k) rate[k] = a[block.dof + k];
            return rate;
        }
        multiply(block, w.now.A, a, w.scratch.r);
        for (size_t k = 0; k < block.kept.size(); ++k)
            if (!depends(static_cast<int>(block.row + k)))
                rate[k] = w.scratch.r[block.row + k] + w.now.values[f.block].bias[block.kept[k]];
        return rate;
    }

    // Power f.u + limit |u|: friction force f at slip u, minus the power of the largest force against u.
    static double missing_power(const Friction& element, const SlipLimits& limit, const Vec3& f, const Vec3& u) {
        if (element.dim > 1) return f.dot(u) + limit.reach() * u.norm();
        return f[0] * u[0] + (u[0] > 0.0 ? limit.forward * u[0] : -limit.backward * u[0]);
    }

    static double excess(const Friction& element, const SlipLimits& limit, const Vec3& f) {
        if (element.dim > 1) return f.norm() - limit.reach();
        return std::max(f[0] - limit.backward, -f[0] - limit.forward);
    }

    // Force at the limit in the direction of x.
    static Vec3 limit_along(const Friction& element, const SlipLimits& limit, const Vec3& x) {
        if (element.dim == 1) return Vec3(x[0] > 0.0 ? limit.backward : -limit.forward, 0.0, 0.0);
        const double size = x.norm();
        return size > 0.0 ? Vec3(limit.reach() / size * x) : Vec3::Zero();
    }

    // Part of a slip velocity that the direction of the friction force f leaves unexplained.
    static double unexplained(const Vec3& f, const Vec3& u) {
        const double size = f.norm();
        if (!(size > 0.0)) return u.norm();
        const Vec3 n = -1.0 / size * f;
        return (u - std::max(0.0, u.dot(n)) * n).norm();
    }

    // f = -limit u / |u|. A change of u by the error of slip velocities may turn it opposite to f.
    double missing_force(const Friction& element, const SlipLimits& limit, const Vec3& f, const Vec3& u) const {
        const double missing = (f - limit_along(element, limit, -1.0 * u)).norm();
        if (!(unexplained(f, u) <= slip_error)) return missing;
        return std::min(missing, (f - limit_along(element, limit, f)).norm());
    }

    void check_friction(int e, double rest) {
        const Friction& element = p.frictions[e];
        const double size = length(p.blocks[element.block]) / scale;
        const Vec3 f = forces.shared_friction[e], u = slip_velocity(w.now, element);
        const double speed = u.norm();
        // Only an element at rest can share its load.
        if (!(size > 0.0) || (speed <= rest && !forces.is_determined[e])) return;
        SlipLimits base = forces.limits[e];
        if (element.gap >= 0 && element.load == Friction::Load::multiplier)
            base = element.constant + element.mu * p.described.share(element.row, forces.shared_lam);
        const SlipLimits kinetic = base * element.speed_factor(speed);
        if (speed > rest) {
            out.coulomb.include(excess(element, kinetic, f) * size, e);
            out.dissipation.include(missing_force(element, kinetic, f, u) * size, e);
            return;
        }
        const Vec3 onset = slip_acceleration_of(element);
        const double begins = onset.norm() / (size * scale * scale);
        const bool moves = begins > law_residual_parameters.tolerance;
        out.coulomb.include(excess(element, moves ? kinetic : base * element.static_ratio, f) * size, e);
        // At rest the force opposes the onset of slip. Below the error of slip accelerations an element at its limit may
        // begin to slip any way, and at the end of a step friction may still oppose the slip before.
        double residual = std::abs(missing_power(element, kinetic, f, onset)) / scale / scale;
        if (begins <= law_residual_parameters.onset_acceleration)
            residual = std::min(residual, std::abs(excess(element, kinetic, f)) * size);
        if (state.is_end) {
            const double before = std::abs(missing_power(element, kinetic, f, -1.0 * onset)) / scale / scale;
            residual = std::min({residual, before, missing_force(element, kinetic, f, u) * size});
        }
        out.dissipation.include(residual, e);
    }
};

// Find the sticking elements with unique shares of the load: multipliers without force do not change these shares.
void find_determined(const Program& p, Workspace& w, std::vector<char>& is_determined) {
    if (!w.now.rows.redundant) return;
    const FreeMultipliers free = free_multipliers(p.blocks, w.now.B, p.described, w.now.rows);
    const auto shares = [&](const Block& block) {
        for (size_t k = 0; k < block.kept.size(); ++k)
            if (free.norm_of_row(block.row + static_cast<int>(k)) > min_null_space_entry) return true;
        return false;
    };
    VecX on_dofs = VecX::Zero(p.mechanism.nv), force = on_dofs, column(p.layout.rows);
    for (Eigen::Index c = 0; c < free.count(); ++c) {
        column.setZero();
        free.add(VecX::Unit(free.count(), c), column);
        force.setZero();
        for (int i : w.now.rows.blocks) add_transpose(p.blocks[i], w.now.A, column, force);
        on_dofs = on_dofs.cwiseMax(force.cwiseAbs());
    }
    for (int e : w.now.loaded_elements) {
        const Friction& f = p.frictions[e];
        if (w.state.mode[e] != sticking) continue;
        const Block& block = p.blocks[f.block];
        bool shared = f.gap >= 0 && shares(p.blocks[p.gaps[f.gap].block]);
        if (!is_locked(w, block)) shared |= shares(block);
        else for (int k = 0; k < block.total; ++k) shared |= on_dofs[block.dof + k] > min_null_space_entry;
        is_determined[e] = !shared;
    }
}

}  // namespace

const MotionForces& motion_forces(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v) {
    MotionForces& out = w.scratch.forces;
    const Evaluation& now = w.now;
    out.given = -now.terms.nle;
    out.magnitude = now.terms.nle.cwiseAbs();
    if (p.driven || now.has_override) {
        out.given += now.tau + now.external;
        out.magnitude += now.tau.cwiseAbs() + now.external.cwiseAbs();
    }
    if (!p.laws.empty()) {
        VecX& C = w.scratch.work;
        C.setZero();
        add_law_forces(p, w, v, C);
        out.given += C;
        out.magnitude += C.cwiseAbs();
    }
    out.lam = now.lam;
    for (int e : now.loaded_elements) out.friction[e] = friction_by_row(p, w, e, now.lam);
    std::fill(out.is_determined.begin(), out.is_determined.end(), char(1));
    const ReportedLoads loads(p, w);
    if (!loads.are_in_cones()) find_determined(p, w, out.is_determined);
    out.shared_lam = reactions(p, w).lam;
    for (int e : now.loaded_elements) {
        const Friction& f = p.frictions[e];
        out.shared_friction[e] = friction_by_row(p, w, e, out.shared_lam);
        // Evaluations read a user's limit of slipping elements only.
        const bool asked = f.load == Friction::Load::user && w.state.mode[e] != sticking;
        const bool known = f.reaction != Reaction::total || asked;
        out.limits[e] = known ? now.load[e] : load_limits(p, w, f, t, q, v);
    }
    return out;
}

LawResiduals law_residuals(const Program& p, Workspace& w, double t, const VecX& v, const VecX& a,
                           const MotionForces& forces, const MotionState& state) {
    Scratch& s = w.scratch;
    const double speed = 1.0 + v.cwiseAbs().maxCoeff();
    Laws laws{p, w, v, a, forces, state, s.law_weight, s.law_residual, s.law_magnitude, law_residual_parameters.min_force,
              std::max(state.slip_error, min_directed_speed * speed), {}};
    laws.weigh();
    laws.check_motion();
    for (int gap : w.now.closed_gaps) laws.check_gap(gap);
    for (int gap : state.open) {
        evaluate_gap(p, w, t, v, gap);
        laws.check_gap(gap);
    }
    for (int e : w.now.loaded_elements) laws.check_friction(e, rest_speed * speed);
    if (w.now.rows.orthogonal) laws.out.friction_tolerance = law_residual_parameters.singular_tolerance;
    return laws.out;
}

std::pair<MotionLaw, LargestResidual> LawResiduals::largest() const {
    std::pair<MotionLaw, LargestResidual> found{MotionLaw::motion, motion};
    double most = motion.size / law_residual_parameters.tolerance;
    const auto compare = [&](MotionLaw law, const LargestResidual& residual, double tolerance) {
        if (residual.size / tolerance <= most) return;
        found = {law, residual};
        most = residual.size / tolerance;
    };
    compare(MotionLaw::signorini, signorini, law_residual_parameters.tolerance);
    compare(MotionLaw::coulomb, coulomb, friction_tolerance);
    compare(MotionLaw::dissipation, dissipation, friction_tolerance);
    return found;
}

bool LawResiduals::are_small() const {
    const double tolerance = law_residual_parameters.tolerance;
    return motion.size <= tolerance && signorini.size <= tolerance && coulomb.size <= friction_tolerance &&
           dissipation.size <= friction_tolerance;
}

Failure LawResiduals::failure(double t) const {
    const auto [law, residual] = largest();
    return {Failure::Kind::unmet_law, t, {static_cast<int>(law), residual.index}, residual.size};
}

LawResiduals check_laws(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, const MotionState& state) {
    if (p.frictions.empty() && p.gaps.empty()) return {};
    const MotionForces& forces = motion_forces(p, w, t, q, v);
    const LawResiduals out = law_residuals(p, w, t, v, w.now.a, forces, state);
    if (!out.are_small()) return out;
    Counters& largest = w.counters;
    largest.motion = std::max(largest.motion, out.motion.size);
    largest.signorini = std::max(largest.signorini, out.signorini.size);
    largest.coulomb = std::max(largest.coulomb, out.coulomb.size);
    largest.dissipation = std::max(largest.dissipation, out.dissipation.size);
    return out;
}

}  // namespace pn
