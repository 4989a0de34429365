#include "dynamics/step_start.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "dynamics/evaluation.hpp"
#include "dynamics/projection.hpp"
#include "dynamics/acceleration.hpp"
#include "tree/mass_factor.hpp"

namespace pn {

// Rows that were found dependent must be met by the solution all the same, to this part of their terms; of
// accelerations in play a thousandth counts, and as many m/s^2 where nothing is accelerated.
constexpr double consistency_tolerance = 1e-6, background = 1e-3;
// By which the drifts of the rows that one depends on may enter its own.
constexpr double dependence_growth = 10.0;
// Modes that change do not stop what moves by more than this part of its energy. Where rows that elements hold would, by
// up to this part of their forces, they hold nothing; it is sought in steps of this factor.
constexpr double stopped_part = 1e-9, most_unheld = 1e-3, unheld_growth = 3.0;

// Length of x in the metric of M, of the part that the rows see.
static double scaled_length(const Program& p, Workspace& w, const VecX& x) {
    VecX& scaled = w.scratch.scaled;
    multiply_M(p.mechanism, w.now.terms, x, scaled);
    for (int dof = 0; dof < p.mechanism.nv; ++dof)
        if (w.now.terms.locked[dof]) scaled[dof] = 0.0;
    solve_R(p.mechanism, w.now.terms, scaled);
    double square = 0.0;
    for (int dof : p.constrained_dofs) square += scaled[dof] * scaled[dof];
    return std::sqrt(square);
}

// Angular speed of the body that turns fastest.
static double fastest_turn(const Workspace& w) {
    double square = 0.0;
    for (const Body& body : w.now.terms.body) square = std::max(square, body.v.ang.squaredNorm());
    return std::sqrt(square);
}

// What a dependent row of unit length may miss beside its own terms: a part of the accelerations of turning, which may
// cancel in each of its terms, and while elements stick what it sees of the motion by the part of itself, below the
// tolerance, that it keeps beside the others.
static double unseen(const Program& p, Workspace& w, const VecX& v) {
    const double speed = scaled_length(p, w, v);
    const double turning = consistency_tolerance * background * speed * fastest_turn(w);
    if (!w.state.sticks_anywhere()) return turning;
    return turning + dependence_growth * w.state.rank_tolerance *
                         (scaled_length(p, w, w.now.a) + speed * v.cwiseAbs().maxCoeff());
}

// Residual of the dependent rows; the worst block, or -1 when all are met.
static int contradicting_block(const Program& p, Workspace& w, const VecX& v, double& worst) {
    int found = -1;
    double excess = 1.0;
    std::optional<double> lacking;  // of a row of unit length
    const double reach = w.now.a.cwiseAbs().maxCoeff() + p.mechanism.gravity.norm() + background;  // accelerations in play
    for (int i : w.now.rows.blocks) {
        const Block& block = p.blocks[i];
        const int n = static_cast<int>(block.kept.size());
        for (int k = 0; k < n; ++k) {
            const int row = block.row + k;
            if (!w.now.rows.required[row] || w.now.rows.active[row]) continue;
            double sum = -w.now.b[row], size = std::abs(w.now.b[row]);
            const double* A = w.now.A.data() + block.offset + k;
            for (size_t l = 0; l < block.support.size(); ++l) {
                const double term = A[l * n] * w.now.a[block.support[l]];
                sum += term;
                size += std::abs(term);
            }
            double allowed = consistency_tolerance * (size + background * reach);
            if (std::abs(sum) <= allowed * excess) continue;
            if (!lacking) lacking = unseen(p, w, v);
            allowed += *lacking / w.now.rows.scale[row];
            if (std::abs(sum) > allowed * excess) {
                excess = std::abs(sum) / allowed;
                worst = sum;
                found = i;
            }
        }
    }
    return found;
}

static void choose_rows_anew(const Program& p, Workspace& w, int most = INT_MAX) {
    choose_rows(p, w, w.state.sticks_anywhere() ? w.state.rank_tolerance : rank_tolerance, most);
    ++w.counters.factorizations;
}

bool configure_step(const Program& p, Workspace& w) {
    w.state.ideal_decided = false;
    if (w.now.rows.blocks.empty()) return false;
    const RowSystem& rows = w.now.rows;
    const bool due = p.gaps.empty() && is_choice_due(p.layout, w.now.rows);  // contacts are chosen with their modes
    if (!rows.orthogonal && !due) return false;
    // The Cholesky factor shows that the active rows are independent: a new choice has at most as many.
    const bool keeps_rank = !rows.orthogonal;
    choose_rows_anew(p, w, keeps_rank ? std::count(rows.active.begin(), rows.active.end(), char(1)) : INT_MAX);
    return true;
}

// Names the contradicting block, and the one that shares the step with it and carries the largest multipliers.
[[noreturn]] static void contradict(const Program& p, const Workspace& w, double t, int block, double residual) {
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

// Laws are asked only once the rows are independent: others give them multipliers that mean nothing.
static void move_step(const Program& p, Workspace& w, double t, const VecX& v, bool chosen) {
    assemble_forces(p, w, t, v);
    solve_dynamics(p, w, t, v);
    if (w.now.rows.blocks.empty() || !w.now.rows.redundant) return;
    double residual = 0.0;
    int block = contradicting_block(p, w, v, residual);
    if (block >= 0 && !chosen) {  // what was dependent at an earlier step is not any more
        choose_rows_anew(p, w);
        solve_dynamics(p, w, t, v);
        block = contradicting_block(p, w, v, residual);
    }
    if (block >= 0) contradict(p, w, t, block, residual);
}

void begin_step(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v) {
    configure(p, w, t, q, v);
    move_step(p, w, t, v, configure_step(p, w));
}

// Part of the kinetic energy of v that the rows in use would take from it.
static double part_stopped(const Program& p, Workspace& w, double t, const VecX& v) {
    VecX kept = v;
    project_velocity(p, w, t, kept);
    const double before = kinetic_energy(p.mechanism, w.now.terms, v);
    const double after = kinetic_energy(p.mechanism, w.now.terms, kept);
    configure_velocity(p, w, t, v);
    return before > 0.0 ? std::abs(before - after) / before : 0.0;
}

void keep_moving(const Program& p, Workspace& w, double t, const VecX& v) {
    if (!w.now.rows.redundant || !w.state.sticks_anywhere() || v.cwiseAbs().maxCoeff() <= immobile_speed) return;
    const auto choose = [&](double tolerance) {
        w.state.rank_tolerance = tolerance;
        choose_rows_anew(p, w);
        move_step(p, w, t, v, true);
    };
    double tolerance = w.state.rank_tolerance;
    while (tolerance < most_unheld && part_stopped(p, w, t, v) > stopped_part) choose(tolerance *= unheld_growth);
    if (tolerance >= most_unheld) choose(rank_tolerance_sticking);
}

bool begin_rows(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v) {
    configure(p, w, t, q, v);
    return configure_step(p, w);
}

void project_into_modes(const Program& p, Workspace& w, double t, VecX& q, VecX& v) {
    begin_rows(p, w, t, q, v);
    project(p, w, t, q, v);
}

bool begin_step_on_rates(const Program& p, Workspace& w, double t, VecX& v, bool chosen, bool evaluates) {
    if (w.state.steps_since != never_decided) ++w.state.steps_since;
    const bool moved = project_velocity(p, w, t, v);
    if (evaluates) move_step(p, w, t, v, chosen);
    return moved;
}

bool begin_step_on_rates(const Program& p, Workspace& w, double t, VecX& v) {
    const bool chosen = configure_step(p, w);
    return begin_step_on_rates(p, w, t, v, chosen, true);
}

}  // namespace pn
