#include "contact/impact.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "contact/contact_rows.hpp"
#include "dynamics/evaluation.hpp"
#include "complementarity/cone/solver.hpp"
#include "friction/stick_slip.hpp"
#include "math/decompositions.hpp"
#include "math/tolerances.hpp"

namespace pn {

namespace {

// Throw a failure: constraints drive bodies into each other, or the impulse solver failed.
[[noreturn]] void refuse(const Program& p, double t, const std::vector<int>& gaps, ConeStatus status) {
    if (status == ConeStatus::failed) throw Failure(Failure::Kind::not_converged, t);
    std::vector<int> blocks;
    for (int gap : gaps) blocks.push_back(p.gaps[gap].block);
    throw Failure(Failure::Kind::inconsistent, t, blocks);
}

// Solve for the impulses of contacts and of boxes of dry friction, for the velocities w0.
VecX percussions(const ContactRows& rows, double t, const MatX& W, const VecX& w0,
                 const std::vector<ConeElement>& elements) {
    VecX P = VecX::Zero(w0.size());
    ConeComplementarity solver;
    solver.use_uniform_compliance(rows.gaps.size() > 1);  // a landing face distributes its impulse over all corners
    const ConeStatus status = solver.solve(W, w0, elements, false, P);
    if (status != ConeStatus::solved) refuse(rows.p, t, rows.gaps, status);
    return P;
}

// Newton's law of restitution: gaps open with e times their closing rate.
VecX newton(const ContactRows& rows, double t, VecX w0) {
    for (size_t i = 0; i < rows.gaps.size(); ++i) {
        double& approach = w0[rows.first[i]];
        approach += rows.p.gaps[rows.gaps[i]].restitution * std::min(0.0, approach);
    }
    return percussions(rows, t, rows.W, w0, rows.cones);
}

// Poisson's law of restitution. After the impulses that stop the approach, each contact exerts e times its own impulse. A
// contact exerts a larger impulse only to prevent penetration. Friction of the restitution impulse has a known limit: a box
// along the directions of the cone for the additional impulse.
VecX poisson(const ContactRows& rows, double t, const VecX& velocity) {
    VecX P = percussions(rows, t, rows.W, velocity, rows.cones);
    std::vector<ConeElement> elements = rows.cones;
    std::vector<int> row(P.size());
    std::iota(row.begin(), row.end(), 0);
    VecX restitution = VecX::Zero(P.size());
    const double min_impulse = impulse_rounding * P.cwiseAbs().maxCoeff();
    for (size_t i = 0; i < rows.gaps.size(); ++i) {
        const double impulse = rows.p.gaps[rows.gaps[i]].restitution * P[rows.first[i]];
        if (!(impulse > min_impulse)) continue;
        restitution[rows.first[i]] = impulse;
        if (!rows.cones[i].slides() || rows.cones[i].bound == 0.0) continue;
        elements.push_back(ConeElement::box(rows.cones[i].dim - 1, rows.cones[i].bound * impulse));
        for (int k = 1; k < rows.cones[i].dim; ++k) row.push_back(rows.first[i] + k);
    }
    if (restitution.isZero(0.0)) return P;
    P += restitution;
    const int n = static_cast<int>(row.size());
    const VecX after = velocity + rows.W * P;
    MatX W(n, n);
    VecX w0(n);
    for (int i = 0; i < n; ++i) {
        w0[i] = after[row[i]];
        for (int j = 0; j < n; ++j) W(i, j) = rows.W(row[i], row[j]);
    }
    const VecX extra_impulse = percussions(rows, t, W, w0, elements);
    for (int i = 0; i < n; ++i) P[row[i]] += extra_impulse[i];
    return P;
}

// Zero the rounding error of velocities that no impulse can change, because constraints or other contacts hold them. Such
// rounding would let sticking contacts slip.
void clean(const ContactRows& rows, double speed, VecX& w0) {
    const Spectrum modes = symmetric_spectrum(rows.W);
    const VecX& response = modes.values;
    for (int i = 0; i < w0.size() && response[i] <= impact_parameters.min_response * response[w0.size() - 1]; ++i) {
        const double component = modes.vectors.col(i).dot(w0);
        if (std::abs(component) <= impact_parameters.velocity_rounding * (1.0 + speed))
            w0 -= component * modes.vectors.col(i);
    }
}

}  // namespace

double rest_rate(const VecX& v) { return rest_speed * (1.0 + v.cwiseAbs().maxCoeff()); }

Impact resolve_impact(const Program& p, Workspace& w, double t, const VecX& q, VecX& v, const std::vector<char>& touching,
              bool bounces) {
    Impact out;
    for (int i = 0; i < static_cast<int>(p.gaps.size()); ++i)
        if (touching[i]) out.gaps.push_back(i);
    release_contacts(p, w, t, q, v, touching);
    const ContactRows rows(p, w, out.gaps);
    VecX velocity = rows.velocity;
    clean(rows, v.cwiseAbs().maxCoeff(), velocity);
    const VecX P = !bounces                              ? percussions(rows, t, rows.W, velocity, rows.cones)
                   : p.impact_law == ImpactLaw::poisson ? poisson(rows, t, velocity)
                                                        : newton(rows, t, velocity);
    out.v_minus = v;
    const double before = kinetic_energy(p.mechanism, w.now.terms, v);
    const VecX dv = rows.response * P;
    v += dv;
    out.v_plus = v;
    out.energy_change = kinetic_energy(p.mechanism, w.now.terms, v) - before;
    // Use the actual velocities: if large impulses have small effects, rounding error of W P would violate the energy
    // balance.
    const VecX mean = rows.velocity + 0.5 * rows.change(dv);
    for (size_t i = 0; i < out.gaps.size(); ++i) {
        Vec3 impulse = Vec3::Zero();
        for (int k = 0; k < rows.cones[i].dim; ++k) impulse[k] = rows.of(P, i)[k];
        out.impulse.push_back(impulse);
        out.work.push_back(rows.of(P, i).dot(rows.of(mean, i)));
    }
    set_closed(p, w, touching);  // restores their rows
    return out;
}

}  // namespace pn
