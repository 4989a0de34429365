#include "dynamics/state_projection.hpp"

#include <algorithm>
#include <cmath>

#include "dynamics/acceleration.hpp"
#include "dynamics/evaluation.hpp"
#include "math/tolerances.hpp"

namespace pn {

namespace {

// Largest residual of the rows that count as dependent.
double dependent_residual(const Program& p, const Workspace& w) {
    double largest = 0.0;
    for (int i : w.now.rows.blocks) {
        const Block& block = p.blocks[i];
        for (size_t k = 0; k < block.kept.size(); ++k) {
            const int row = block.row + static_cast<int>(k);
            if (w.now.rows.active[row] || row >= p.constraint_rows()) continue;
            largest = std::max(largest, std::abs(w.now.values[i].residual[block.kept[k]]));
        }
    }
    return largest;
}

void configure_anew(const Program& p, Workspace& w, double t, VecX& q, const VecX& v) {
    set_modes(p, w, std::vector<Mode>(p.frictions.size(), slip_plus));
    configure(p, w, t, q, v);
    choose_rows_near(p, w, t, q, v);  // their Cholesky factor does not prove that they are independent
}

// Move penetrating bodies out to the contact plane. The velocity later decides between rest and impact.
void project_out(const Program& p, Workspace& w, double t, VecX& q, const VecX& v) {
    update_kinematics(p, w, t, q, v);
    std::vector<char> inside(p.gaps.size(), 0);
    for (size_t i = 0; i < p.gaps.size(); ++i) {
        const double width = measured_width(p, w, t, v, static_cast<int>(i));
        inside[i] = width < 0.0 && !p.blocks[p.gaps[i].block].kept.empty();
    }
    set_closed(p, w, inside);
    configure_anew(p, w, t, q, v);
    project_position(p, w, t, q, v);
    set_closed(p, w, std::vector<char>(p.gaps.size(), 0));
}

}  // namespace

bool project_onto_dependent(const Program& p, Workspace& w, double t, VecX& q, const VecX& v) {
    if (!w.now.rows.redundant || !p.gaps.empty() || w.state.sticks_anywhere()) return false;
    const int rank = w.now.rows.active_count();
    bool moved = false;
    const auto is_open = [&] {
        return dependent_residual(p, w) > state_projection_parameters.creeping_gap * scene_size(p, w);
    };
    for (int k = 0; k < state_projection_parameters.max_row_choices &&
                    (is_open() || (k == 0 && w.now.rows.distance < near_singular_pivot));
         ++k) {
        configure(p, w, t, q, v);
        choose_rows(p, w, rank_tolerance, rank);
        moved |= project_position(p, w, t, q, v);
    }
    return moved;
}

bool project_past_sticking(const Program& p, Workspace& w, double t, VecX& q, const VecX& v) {
    if (!w.now.rows.redundant || !w.state.sticks_anywhere()) return false;
    if (dependent_residual(p, w) <= state_projection_parameters.creeping_gap * scene_size(p, w)) return false;
    const std::vector<Mode> modes = w.state.mode;
    std::vector<Mode> released = modes;
    std::replace(released.begin(), released.end(), sticking, unloaded);
    set_modes(p, w, released);
    configure(p, w, t, q, v);
    if (w.now.rows.orthogonal) choose_rows(p, w);
    project_position(p, w, t, q, v);
    set_modes(p, w, modes);
    configure(p, w, t, q, v);
    return true;
}

bool project(const Program& p, Workspace& w, double t, VecX& q, VecX& v) {
    bool moved = project_position(p, w, t, q, v);
    moved |= project_onto_dependent(p, w, t, q, v);
    return project_velocity(p, w, t, v) || moved;
}

void project_and_evaluate(const Program& p, Workspace& w, double t, VecX& q, VecX& v) {
    project(p, w, t, q, v);
    assemble_forces(p, w, t, v);
    solve_dynamics(p, w, t, v);
}

bool choose_rows_near(const Program& p, Workspace& w, double t, VecX& q, const VecX& v, int max_rank) {
    if (w.now.rows.blocks.empty()) return false;
    if (!w.now.rows.orthogonal && w.now.rows.has_rank_up_to(max_rank)) return false;
    if (!p.gaps.empty() || w.state.sticks_anywhere()) {
        choose_rows(p, w);
        return false;
    }
    const VecX start = q;
    bool moved = false;
    for (double tolerance : state_projection_parameters.tolerances_near) {
        choose_rows(p, w, tolerance, max_rank);
        moved = project_position(p, w, t, q, v);
        if (dependent_residual(p, w) <= state_projection_parameters.creeping_gap * scene_size(p, w)) break;
        q = start;
        moved = false;
        configure(p, w, t, q, v);
    }
    choose_rows(p, w);
    return moved;
}

void project_anew(const Program& p, Workspace& w, double t, VecX& q, VecX& v) {
    if (!p.gaps.empty()) project_out(p, w, t, q, v);
    configure_anew(p, w, t, q, v);
    if (!w.now.rows.blocks.empty()) project(p, w, t, q, v);
}

Closure close(const Program& p, Workspace& w, double t, VecX& q, VecX& v, double max_residual) {
    Closure found;
    update_kinematics(p, w, t, q, v);
    violations(p, w, t, v, found.before, found.rate);
    found.after = found.before;
    if (!(found.before <= max_residual)) return found;
    project_anew(p, w, t, q, v);
    update_kinematics(p, w, t, q, v);
    violations(p, w, t, v, found.after, found.rate);
    return found;
}

}  // namespace pn
