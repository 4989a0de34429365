// The evaluation of Eq. (40) at one state, and the choice of independent rows.
#include <algorithm>
#include <cmath>

#include "dynamics/evaluation.hpp"
#include "constraints/projection.hpp"
#include "tree/factor.hpp"

namespace pn {

namespace {

// Rows that were found dependent must be met by the solution all the same, to this part of their terms.
constexpr double consistency_tolerance = 1e-6;
// Pivots of M that differ by more than this (bodies of very unequal mass, or massless ones) cost the row equations
// the same factor in accuracy; two passes of refinement give it back.
constexpr double refined_pivot_ratio = 1e6;
constexpr int refinement_passes = 2;
// A configuration that gives a larger inertia [kg m^2] has run away.
constexpr double runaway_inertia = 1e30;

}  // namespace

void want_rows(const Program& p, Workspace& w) {
    for (int r = 0; r < p.layout.rows; ++r) w.now.rows.wanted[r] = r < p.constraint_rows();
    std::fill(w.now.terms.locked.begin(), w.now.terms.locked.end(), char(0));
    for (size_t e = 0; e < p.frictions.size(); ++e) {
        const Block& block = p.blocks[p.frictions[e].block];
        if (w.state.mode[e] != sticking) continue;
        if (const auto* d = std::get_if<DofRows>(&block.kind))
            for (int k = 0; k < d->count; ++k) w.now.terms.locked[d->dof + k] = 1;
        else
            for (size_t k = 0; k < block.kept.size(); ++k) w.now.rows.wanted[block.row + k] = 1;
    }
    w.now.rows.use_wanted(p.blocks);
    w.state.ideal_decided = false;
}

void factor_mass(const Program& p, Workspace& w, double t) {
    const int dof = factorize(p.mechanism, w.now.terms);
    if (dof < 0) return;
    if (!w.now.terms.q.allFinite() || !(w.now.terms.M[p.mechanism.row_offset[dof]] < runaway_inertia))
        throw Failure(Failure::Kind::not_finite, t);
    throw Failure(Failure::Kind::singular_mass, t, {dof});
}

void gaps(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v) {
    place_bodies(p.mechanism, w.now.terms, q, p.touched_joints, p.touched_angles);
    const State state{p.mechanism, w.now.terms, t, w.now.terms.q, v};
    for (int i = 0; i < p.constraints; ++i) evaluate(p.blocks[i].kind, state, Part::gap, w.now.values[i]);
}

// Residuals and A; and the users' own b.
static void place_rows(const Program& p, Workspace& w, double t, const VecX& v) {
    const State state{p.mechanism, w.now.terms, t, w.now.terms.q, v};
    for (size_t i = 0; i < p.blocks.size(); ++i) {
        const Block& block = p.blocks[i];
        RowValues& values = w.now.values[i];
        evaluate(block.kind, state, Part::place, values);
        if (values.has_A) continue;
        fill_A(block, w.now.terms, values, w.now.A.data() + block.offset);
        values.has_A = values.constant_A;
    }
}

// Rates and b.
static void move_rows(const Program& p, Workspace& w, double t, const VecX& v) {
    const State state{p.mechanism, w.now.terms, t, w.now.terms.q, v};
    for (size_t i = 0; i < p.blocks.size(); ++i) {
        const Block& block = p.blocks[i];
        RowValues& values = w.now.values[i];
        evaluate(block.kind, state, Part::motion, values);
        for (size_t k = 0; k < block.kept.size(); ++k) w.now.b[block.row + k] = -values.drift[block.kept[k]];
    }
}

void evaluate_rows(const Program& p, Workspace& w, double t, const VecX& v) {
    place_rows(p, w, t, v);
    move_rows(p, w, t, v);
}

void look_at(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v) {
    kinematics(p.mechanism, w.now.terms, q, v);
    evaluate_rows(p, w, t, v);
}

void scale_rows(const Program& p, Workspace& w) {
    for (int i : w.now.rows.blocks) {
        const Block& block = p.blocks[i];
        scale_rows(p.mechanism, w.now.terms, block, w.now.A.data() + block.offset, w.now.B.data() + block.offset);
    }
}

// x := R^-1 x, then x and the multipliers of Eq. (40) in scaled coordinates for rows that miss r = b - A a' or, given
// x = 0, A a = r; x ends as an acceleration.
static void constrained_solve(const Program& p, Workspace& w, VecX& x, const VecX& b, VecX& lam) {
    solve_R(p.mechanism, w.now.terms, x);  // a_s' = R^-1 (F + C)
    if (!w.now.rows.blocks.empty()) {
        for (int i : w.now.rows.blocks) {
            const Block& block = p.blocks[i];
            multiply(block, w.now.B, x, w.scratch.r);
            for (size_t k = 0; k < block.kept.size(); ++k) w.scratch.r[block.row + k] = b[block.row + k] - w.scratch.r[block.row + k];
        }
        solve_rows(p.layout, w.now.rows, w.scratch.r, lam);
        for (int i : w.now.rows.blocks) add_transpose(p.blocks[i], w.now.B, lam, x);  // Eq. (40), scaled
    }
    solve_Rt(p.mechanism, w.now.terms, x);
}

bool is_immobile(const Program& p, const Workspace& w) {
    if (p.moves_in_time || p.frictions.empty()) return false;
    int held = 0;
    for (char locked : w.now.terms.locked) held += locked;
    bool sticks = held > 0;
    for (int i : w.now.rows.blocks) {
        const Block& block = p.blocks[i];
        for (size_t k = 0; k < block.kept.size(); ++k) held += w.now.rows.active[block.row + k];
        sticks |= i >= p.constraints;
    }
    return sticks && held >= p.mechanism.nv;
}

const VecX& holding_forces(const Program& p, Workspace& w) {
    if (w.now.has_balance) return w.now.balance;
    w.now.has_balance = true;
    multiply_M(p.mechanism, w.now.terms, w.now.a, w.now.balance);
    w.now.balance -= w.now.F + w.now.C;
    w.scratch.work.setZero();
    for (int i : w.now.rows.blocks) add_transpose(p.blocks[i], w.now.A, w.now.lam, w.scratch.work);
    w.now.balance -= w.scratch.work;
    return w.now.balance;
}

void solve_motion(const Program& p, Workspace& w, const VecX& force) {
    w.now.has_balance = false;
    w.now.a = force;
    constrained_solve(p, w, w.now.a, w.now.b, w.now.lam);
    if (w.now.rows.blocks.empty() || !w.now.rows.refine) return;
    for (int pass = 0; pass < refinement_passes; ++pass) {  // what the equations still miss is solved for again
        multiply_M(p.mechanism, w.now.terms, w.now.a, w.scratch.scaled);
        w.scratch.scaled_free = force - w.scratch.scaled;
        for (int i : w.now.rows.blocks) {
            const Block& block = p.blocks[i];
            add_transpose(block, w.now.A, w.now.lam, w.scratch.scaled_free);
            multiply(block, w.now.A, w.now.a, w.scratch.r);
            for (size_t k = 0; k < block.kept.size(); ++k) w.scratch.miss[block.row + k] = w.now.b[block.row + k] - w.scratch.r[block.row + k];
        }
        constrained_solve(p, w, w.scratch.scaled_free, w.scratch.miss, w.scratch.lam_step);
        w.now.a += w.scratch.scaled_free;
        w.now.lam += w.scratch.lam_step;
    }
}

static void factor_placed_rows(const Program& p, Workspace& w, double t, const VecX& v) {
    place_rows(p, w, t, v);
    if (w.now.rows.blocks.empty()) return;
    scale_rows(p, w);
    factor_rows(p.layout, p.blocks, w.now.B, w.now.rows);
    ++w.counters.factorizations;
    w.now.rows.refine = w.now.terms.D.maxCoeff() > refined_pivot_ratio * w.now.terms.D.minCoeff();
}

void configure(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v) {
    place_bodies(p.mechanism, w.now.terms, q);
    mass_matrix(p.mechanism, w.now.terms);
    factor_mass(p, w, t);
    if (!p.blocks.empty()) factor_placed_rows(p, w, t, v);
}

void configure_velocity(const Program& p, Workspace& w, double t, const VecX& v) {
    if (!p.affine_rates) factor_placed_rows(p, w, t, v);
}

// F and b, which depend on the velocity.
static void drive(const Program& p, Workspace& w, double t, const VecX& v) {
    ++w.counters.evaluations;
    move_bodies(p.mechanism, w.now.terms, v);
    bias_forces(p.mechanism, w.now.terms);
    w.now.F = -w.now.terms.nle;
    if (p.driven || w.now.has_override) {
        given_forces(p, w, t, w.now.terms.q, v);
        w.now.F += w.now.tau + w.now.external;
    }
    if (!p.blocks.empty()) move_rows(p, w, t, v);
}

// a, lam and C of what has been assembled.
static void respond(const Program& p, Workspace& w, double t, const VecX& v) {
    if (!p.has_laws()) {
        solve_motion(p, w, w.now.F);
    } else {
        w.now.speed = v.cwiseAbs().maxCoeff();
        smooth_laws(p, w, t, w.now.terms.q, v);
        if (p.needs_reactions) {
            solve_reactions(p, w, t, w.now.terms.q, v);
        } else {
            w.now.C = w.now.C_smooth;
            w.scratch.trial = w.now.F + w.now.C;
            solve_motion(p, w, w.scratch.trial);
        }
    }
    if (!w.now.a.allFinite()) throw Failure(Failure::Kind::not_finite, t);
    if (is_immobile(p, w) && (v.array() == 0.0).all()) w.now.a.setZero();
}

void evaluate(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v) {
    configure(p, w, t, q, v);
    drive(p, w, t, v);
    respond(p, w, t, v);
}

void evaluate_on_constraints(const Program& p, Workspace& w, double t, VecX& q, VecX& v) {
    project(p, w, t, q, v);
    drive(p, w, t, v);
    respond(p, w, t, v);
}

// Residual of the dependent rows; the worst block, or -1 when all are met.
static int contradicting_block(const Program& p, Workspace& w, double& worst) {
    int found = -1;
    double excess = 1.0;
    const double reach = w.now.a.cwiseAbs().maxCoeff() + p.mechanism.gravity.norm() + 1e-3;  // accelerations in play
    for (int i : w.now.rows.blocks) {
        const Block& block = p.blocks[i];
        const int n = static_cast<int>(block.kept.size());
        for (int k = 0; k < n; ++k) {
            const int row = block.row + k;
            if (!w.now.rows.wanted[row] || w.now.rows.active[row]) continue;
            double sum = -w.now.b[row], size = std::abs(w.now.b[row]);
            const double* A = w.now.A.data() + block.offset + k;
            for (size_t l = 0; l < block.support.size(); ++l) {
                const double term = A[l * n] * w.now.a[block.support[l]];
                sum += term;
                size += std::abs(term);
            }
            const double allowed = consistency_tolerance * (size + 1e-3 * reach);
            if (std::abs(sum) > allowed * excess) {
                excess = std::abs(sum) / allowed;
                worst = sum;
                found = i;
            }
        }
    }
    return found;
}

static void choose_rows(const Program& p, Workspace& w) {
    const bool sticks = std::count(w.state.mode.begin(), w.state.mode.end(), sticking) > 0;
    decide_rows(p.layout, p.blocks, w.now.B, w.now.rows, sticks ? rank_tolerance_sticking : rank_tolerance);
    factor_rows(p.layout, p.blocks, w.now.B, w.now.rows);
    ++w.counters.factorizations;
}

// Chooses the rows of a step where the factors found there ask for it; returns whether it did.
static bool configure_step(const Program& p, Workspace& w) {
    w.state.ideal_decided = false;
    if (w.now.rows.blocks.empty() || !w.now.rows.orthogonal) return false;
    choose_rows(p, w);
    return true;
}

// Laws are asked only once the rows are independent: others give them multipliers that mean nothing.
static void move_step(const Program& p, Workspace& w, double t, const VecX& v, bool chosen) {
    drive(p, w, t, v);
    respond(p, w, t, v);
    if (w.now.rows.blocks.empty() || !w.now.rows.redundant) return;
    double residual = 0.0;
    int block = contradicting_block(p, w, residual);
    if (block >= 0 && !chosen) {  // what was dependent at an earlier step is not any more
        choose_rows(p, w);
        respond(p, w, t, v);
        block = contradicting_block(p, w, residual);
    }
    if (block < 0) return;
    // Name the contradicting block and those that share its dofs and carry the largest multipliers.
    std::vector<int> blame{block};
    double largest = -1.0;
    int other = -1;
    for (int i : w.now.rows.blocks) {
        if (i == block) continue;
        const double size = w.now.lam.segment(p.blocks[i].row, p.blocks[i].kept.size()).cwiseAbs().maxCoeff();
        if (size > largest) { largest = size; other = i; }
    }
    if (other >= 0) blame.push_back(other);
    throw Failure(Failure::Kind::inconsistent, t, blame, residual);
}

void begin_step(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v) {
    configure(p, w, t, q, v);
    move_step(p, w, t, v, configure_step(p, w));
}

bool begin_step_on_rates(const Program& p, Workspace& w, double t, VecX& v) {
    const bool chosen = configure_step(p, w);
    const bool moved = project_velocity(p, w, t, v);
    move_step(p, w, t, v, chosen);
    return moved;
}

void violations(const Program& p, const Workspace& w, double& position, double& velocity) {
    position = velocity = 0.0;
    for (int i = 0; i < p.constraints; ++i) {
        const RowValues& values = w.now.values[i];
        for (int k = 0; k < values.rows; ++k) {
            position = std::max(position, std::abs(values.residual[k]));
            velocity = std::max(velocity, std::abs(values.rate[k]));
        }
    }
}

}  // namespace pn
