#include "run/integrators.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "math/lanes.hpp"
#include "dynamics/evaluation.hpp"
#include "friction/modes.hpp"
#include "constraints/projection.hpp"
#include "run/tableaux.hpp"
#include "tree/factor.hpp"
#include "tree/liegroup.hpp"

namespace pn {

// Part of its limit to which the force of a sticking element is resolved over a step.
constexpr double watch_tolerance = 1e-4;
// Rounding in one velocity, as a part of the largest: a joint that constraints drive slowly beside fast ones has no
// digits below it, and no step is short enough to find some.
constexpr double velocity_rounding = 64 * std::numeric_limits<double>::epsilon();
// A load that jumps keeps its error in steps however short; shorter ones than this pass over it [s].
constexpr double shortest_watch = 1e-9;

Method method_named(const std::string& name) {
    using K = Method::Kind;
    namespace tb = tableau;
    if (name == "dop853") return {K::dop853, 12, 8, true, tb::dop853_A, tb::dop853_B, tb::dop853_C};
    if (name == "dopri5") return {K::dopri5, 6, 5, true, tb::dopri5_A, tb::dopri5_B, tb::dopri5_C};
    if (name == "rk4") return {K::rk4, 4, 4, false, tb::rk4_A, tb::rk4_B, tb::rk4_C};
    if (name == "semi_implicit_euler") return {K::semi_implicit_euler, 1, 1, false, nullptr, nullptr, nullptr};
    if (name == "moreau") return {K::moreau, 1, 1, false, nullptr, nullptr, nullptr};
    throw std::invalid_argument("unknown method " + name);
}

System::System(const Program& program, Workspace& workspace, bool with_energy)
    : p(program), w(workspace), energy(with_energy), nq(p.mechanism.nq), nv(p.mechanism.nv), nz(p.states),
      nw(with_energy ? 3 + static_cast<int>(p.law_names.size()) : 0), ne(static_cast<int>(program.frictions.size())),
      ny(nq + nv + nz + nw + ne),
      q_buffer(VecX::Zero(nq)), v_buffer(VecX::Zero(nv)), projected(VecX::Zero(ny)) {}

void System::derivative(double t, const VecX& y, VecX& dy) {
    q_buffer = y.head(nq);
    v_buffer = y.segment(nq, nv);
    if (nz > 0) w.state.z = y.segment(nq + nv, nz);
    if (!on_constraints) {
        evaluate(p, w, t, q_buffer, v_buffer);
        if (!w.now.rows.blocks.empty()) smallest_pivot = std::min(smallest_pivot, w.now.rows.distance);
        collect(t, y, dy);
        return;
    }
    project_and_evaluate(p, w, t, q_buffer, v_buffer);
    smallest_pivot = std::min(smallest_pivot, w.now.rows.distance);
    projected = y;
    projected.head(nq) = q_buffer;
    projected.segment(nq, nv) = v_buffer;
    collect(t, projected, dy);
}

void System::collect(double t, const VecX& y, VecX& dy) {
    configuration_rate(p.mechanism, y.data(), y.data() + nq, dy.data());
    dy.segment(nq, nv) = w.now.a;
    if (nz > 0) dy.segment(nq + nv, nz) = w.now.dz;
    if (energy) {
        v_buffer = y.segment(nq, nv);
        powers(p, w, v_buffer, dy.data() + nq + nv + nz);
    }
    for (int e = 0; e < ne; ++e) {
        double& share = dy[ny - ne + e];
        share = 0.0;
        if (w.state.mode[e] != sticking || w.state.indeterminate) continue;
        q_buffer = y.head(nq);
        v_buffer = y.segment(nq, nv);
        const double limit = static_limit(p, w, e, t, q_buffer, v_buffer);
        const Vec3 force = friction_force(p, w, e);  // of one direction with its sign: smooth where it passes zero
        share = (p.frictions[e].dim == 1 ? force[0] : force.norm()) / std::max(limit, 1e-300);
    }
}

void powers(const Program& p, Workspace& w, const VecX& v, double* out) {
    out[0] = p.driven ? v.dot(w.now.tau) : 0.0;
    out[1] = p.driven ? v.dot(w.now.external) : 0.0;
    out[2] = 0.0;
    if (!w.now.rows.blocks.empty()) {
        w.scratch.work.setZero();
        for (int i : w.now.rows.blocks) add_transpose(p.blocks[i], w.now.A, w.now.lam, w.scratch.work);
        out[2] = v.dot(w.scratch.work);
    }
    if (!p.has_laws()) return;
    law_forces(p, w, v, w.scratch.law_force);
    for (size_t l = 0; l < p.law_names.size(); ++l) out[3 + l] = v.dot(w.scratch.law_force[l]);
}

// out = y + (part_0 K_0 + ... + part_{n-1} K_{n-1}) for as many numbers from i as `Several` holds.
template <class Several>
static PN_INLINE void combine_at(int i, const VecX& y, const double* part, const Combination& sum, VecX& out) {
    Several x, k;
    load(y.data() + i, x);
    for (int j = 0; j < sum.terms; ++j) {
        load(sum.rate[j] + i, k);
        x += part[j] * k;
    }
    store(x, out.data() + i);
}

// out = y + h (a_0 K_0 + ... + a_{n-1} K_{n-1})
PN_WIDE static void combine(const VecX& y, double h, const Combination& sum, VecX& out) {
    double part[most_stages];
    for (int j = 0; j < sum.terms; ++j) part[j] = h * sum.weight[j];
    const int size = static_cast<int>(y.size());
    int i = 0;
    for (; i + 3 < size; i += 4) combine_at<Lanes>(i, y, part, sum, out);
    if (i + 1 < size) {
        combine_at<TwoLanes>(i, y, part, sum, out);
        i += 2;
    }
    if (i < size) combine_at<double>(i, y, part, sum, out);
}

Combination::Combination(const double* weights, int n, const std::vector<VecX>& K) {
    for (int j = 0; j < n; ++j) {
        if (weights[j] == 0.0) continue;
        weight[terms] = weights[j];
        rate[terms++] = K[j].data();
    }
}

Stepper::Stepper(const Method& m, System& s) : method(m), system(s) {
    const int stages = m.kind == Method::Kind::dop853 ? most_stages : std::max(m.stages, 1);
    K.assign(stages, VecX::Zero(s.ny));
    for (VecX* x : {&y0, &y1, &stage, &error5, &error3, &f1, &probe_, &probe_rate_}) *x = VecX::Zero(s.ny);
    tangent = VecX::Zero(2 * s.nv + s.nz);
    scale_ = tangent;
    dense.assign(m.kind == Method::Kind::dop853 ? 7 : 4, VecX::Zero(s.ny));
    if (!m.A) return;
    const double* a = m.A;
    for (int i = 1; i < m.stages; a += i++) to_stage_.emplace_back(a, i, K);
    to_end_ = Combination(m.B, m.stages, K);
    if (m.kind != Method::Kind::dop853) return;
    to_error5_ = Combination(tableau::dop853_E5, m.stages, K);
    to_error3_ = Combination(tableau::dop853_E3, m.stages, K);
}

void Stepper::step(double t, double size) {
    t0 = t;
    h = size;
    has_dense = false;
    if (method.kind == Method::Kind::semi_implicit_euler) {
        // v1 = v0 + h a(q0, v0), q1 = q0 moved by h v1, near the constraints; z and work by Euler's rule.
        const int nq = system.nq, nv = system.nv;
        y1 = y0 + h * K[0];
        system.v_buffer = h * y1.segment(nq, nv);
        follow_constraints(system.p, system.w, h, system.v_buffer);
        retract(system.p.mechanism, y0.data(), system.v_buffer.data(), y1.data());
        return;
    }
    for (int i = 1; i < method.stages; ++i) {
        combine(y0, h, to_stage_[i - 1], stage);
        system.derivative(t + method.C[i] * h, stage, K[i]);
    }
    combine(y0, h, to_end_, y1);
    normalize(system.p.mechanism, y1.data());
}

void Stepper::magnitude(const VecX& y, VecX& out) const {
    for (const Chart& c : system.p.mechanism.charts) {
        const int turning = c.kind == Chart::Kind::pose ? 3 : c.kind == Chart::Kind::plane ? 2 : 0;
        const int n = c.kind == Chart::Kind::vector ? c.n : c.kind == Chart::Kind::pose ? 6
                      : c.kind == Chart::Kind::circle ? 1 : 3;
        for (int k = 0; k < n; ++k) {  // an angle of a rotation counts as one radian
            const bool plain = c.kind == Chart::Kind::vector || k < turning;
            out[c.iv + k] = std::max(out[c.iv + k], plain ? std::abs(y[c.iq + k]) : 1.0);
        }
    }
    const int nq = system.nq, nv = system.nv;
    for (int k = 0; k < nv + system.nz; ++k) out[nv + k] = std::max(out[nv + k], std::abs(y[nq + k]));
}

// Turns magnitudes into the errors that a step may make.
void Stepper::to_tolerances(double rtol, const VecX& atol) {
    const double rounding = velocity_rounding * scale_.segment(system.nv, system.nv).maxCoeff();
    scale_ = atol + rtol * scale_;
    auto velocities = scale_.segment(system.nv, system.nv);
    velocities = velocities.cwiseMax(rounding);
}

double Stepper::norm(const VecX& dy, const VecX& scale, const VecX& y) {
    const int nq = system.nq, nv = system.nv;
    int n = 2 * nv + system.nz;
    ambient_to_tangent(system.p.mechanism, y.data(), dy.data(), tangent.data());
    tangent.segment(nv, nv + system.nz) = dy.segment(nq, nv + system.nz);
    if (system.on_constraints) {
        remove_normal_part(0);
        remove_normal_part(nv);
    }
    double sum = 0.0;
    for (int k = 0; k < 2 * nv + system.nz; ++k) {
        const double x = tangent[k] / scale[k];
        sum += x * x;
    }
    for (int e = 0; e < system.ne; ++e) {
        if (system.w.state.mode[e] != sticking) continue;
        const double x = dy[system.ny - system.ne + e] / watch_scale_;
        sum += x * x;
        ++n;
    }
    return std::sqrt(sum / n);
}

// Takes from the tangent coordinates at `start` what the rows forbid: the projection at the step's end removes it, and
// near a singular position it is noise.
void Stepper::remove_normal_part(int start) {
    Workspace& w = system.w;
    auto part = tangent.segment(start, system.nv);
    w.scratch.work = part;
    for (int i : w.now.rows.blocks) multiply(system.p.blocks[i], w.now.A, w.scratch.work, w.scratch.r);
    solve_rows(system.p.layout, w.now.rows, w.scratch.r, w.now.lam);
    w.scratch.work.setZero();
    for (int i : w.now.rows.blocks) add_transpose(system.p.blocks[i], w.now.B, w.now.lam, w.scratch.work);
    solve_Rt(system.p.mechanism, w.now.terms, w.scratch.work);
    part -= w.scratch.work;
}

double Stepper::error_norm(double rtol, const VecX& atol) {
    scale_.setZero();
    magnitude(y0, scale_);
    magnitude(y1, scale_);
    to_tolerances(rtol, atol);
    watch_scale_ = watch_tolerance * std::max(std::abs(h), shortest_watch);
    error5.setZero();
    if (method.kind == Method::Kind::dopri5) {
        for (int j = 0; j < 6; ++j) error5 += (h * tableau::dopri5_E[j]) * K[j];
        error5 += (h * tableau::dopri5_E[6]) * f1;
        return norm(error5, scale_, y0);
    }
    error3.setZero();
    combine(error5, 1.0, to_error5_, error5);
    combine(error3, 1.0, to_error3_, error3);
    const double e5 = norm(error5, scale_, y0), e3 = norm(error3, scale_, y0);
    if (e5 == 0.0 && e3 == 0.0) return 0.0;
    return std::abs(h) * e5 * e5 / std::sqrt(e5 * e5 + 0.01 * e3 * e3);
}

void Stepper::make_dense() {
    if (has_dense) return;
    has_dense = true;
    const VecX delta = y1 - y0;
    if (method.kind == Method::Kind::dop853) {
        const double* a = tableau::dop853_A_dense;
        K[12] = f1;
        for (int i = 0; i < 3; a += 13 + i++) {
            combine(y0, h, Combination(a, 13 + i, K), stage);
            system.derivative(t0 + tableau::dop853_C_dense[i] * h, stage, K[13 + i]);
        }
        dense[0] = delta;
        dense[1] = h * K[0] - delta;
        dense[2] = 2.0 * delta - h * (f1 + K[0]);
        for (int i = 0; i < 4; ++i) {
            dense[3 + i].setZero();
            combine(dense[3 + i], h, Combination(tableau::dop853_D + 16 * i, 16, K), dense[3 + i]);
        }
        return;
    }
    if (method.kind == Method::Kind::dopri5) {
        for (int i = 0; i < 4; ++i) {
            dense[i] = (h * tableau::dopri5_P[4 * 6 + i]) * f1;
            for (int j = 0; j < 6; ++j) dense[i] += (h * tableau::dopri5_P[4 * j + i]) * K[j];
        }
        return;
    }
    dense[0] = delta;  // a line for the method of order 1, else the cubic through both ends and their rates
    if (method.order < 2) {
        dense[1].setZero();
        dense[2].setZero();
        return;
    }
    dense[1] = h * K[0] - delta;
    dense[2] = 2.0 * delta - h * (f1 + K[0]);
}

void Stepper::interpolate(double s, VecX& y) const {
    if (method.kind == Method::Kind::dopri5) {
        y = y0 + s * (dense[0] + s * (dense[1] + s * (dense[2] + s * dense[3])));
    } else {
        const int n = method.kind == Method::Kind::dop853 ? 7 : 3;
        y.setZero();
        for (int i = n - 1; i >= 0; --i) {  // ((...) (1 - s)) s, alternating from the last coefficient
            y += dense[i];
            y *= i % 2 == 0 ? s : 1.0 - s;
        }
        y += y0;
    }
    normalize(system.p.mechanism, y.data());
}

double Stepper::initial_step(double t, const VecX& y, double rtol, const VecX& atol, double limit) {
    scale_.setZero();
    magnitude(y, scale_);
    to_tolerances(rtol, atol);
    watch_scale_ = watch_tolerance;
    VecX plain = y;
    for (const Chart& c : system.p.mechanism.charts)
        if (c.kind != Chart::Kind::vector) plain.segment(c.iq, 1).setZero();
    const double d0 = norm(plain, scale_, y), d1 = norm(K[0], scale_, y);
    double h0 = d0 < 1e-5 || d1 < 1e-5 ? 1e-6 : 0.01 * d0 / d1;
    h0 = std::min(h0, limit);
    probe_ = y + h0 * K[0];
    normalize(system.p.mechanism, probe_.data());
    system.derivative(t + h0, probe_, probe_rate_);
    probe_rate_ -= K[0];
    const double d2 = norm(probe_rate_, scale_, y) / h0;
    const double top = std::max(d1, d2);
    const double h1 = top <= 1e-15 ? std::max(1e-6, h0 * 1e-3) : std::pow(0.01 / top, 1.0 / method.order);
    return std::min({100.0 * h0, h1, limit});
}

}  // namespace pn
