#include "contact/depenetration.hpp"

#include <algorithm>
#include <cmath>

#include "contact/contact_rows.hpp"
#include "contact/queries.hpp"
#include "dynamics/evaluation.hpp"
#include "dynamics/projection.hpp"
#include "dynamics/step_start.hpp"
#include "complementarity/cone/solver.hpp"
#include "tree/lie_group.hpp"
#include "math/tolerances.hpp"

namespace pn {

namespace {

VecX widths(const Program& p, Workspace& w, double t, const VecX& v, const std::vector<int>& gaps) {
    VecX out(gaps.size());
    for (size_t k = 0; k < gaps.size(); ++k) {
        evaluate_gap(p, w, t, v, gaps[k]);
        out[k] = gap_width(p, w, gaps[k]);
    }
    return out;
}

}  // namespace

double longest_single_move(const Program& p, const Workspace& w) {
    double longest = 0.0;
    for (int i : w.now.closed_gaps) {
        const Block& block = p.blocks[p.gaps[i].block];
        if (!block.kept.empty()) longest = std::max(longest, std::abs(gap_width(p, w, i)) * w.now.rows.scale[block.row]);
    }
    return longest;
}

bool left_planes(const Program& p, Workspace& w, double longest_single) {
    const double allowed = max_projected_gap * scene_size(p, w);
    double widest = 0.0;
    for (int i : w.now.closed_gaps) {
        if (opening(p, w, p.gaps[i].block, allowed) != 0.0) return true;
        widest = std::max(widest, longest_single / w.now.rows.scale[p.blocks[p.gaps[i].block].row]);
    }
    return widest > allowed &&
           !(closing_distance(p, w) <= depenetration_parameters.max_move_ratio * longest_single);
}

bool depenetrate(const Program& p, Workspace& w, double t, VecX& q, const VecX& v) {
    const std::vector<char> closed = w.state.closed;
    const std::vector<Mode> modes = w.state.mode;
    const VecX start = q;
    std::vector<int> gaps;
    for (int i : w.now.closed_gaps)
        if (!is_bare(p, i)) gaps.push_back(i);
    free_contacts(p, w, closed);
    const double rounding = touching_width * scene_size(p, w);
    VecX move = VecX::Zero(p.mechanism.nv), press = VecX::Zero(gaps.size()), width = press, step;
    ConeComplementarity solver;
    bool outside = false;
    for (int k = 0; k < depenetration_parameters.max_steps; ++k) {
        begin_rows(p, w, t, q, v, max_rank_near(w));
        project_position(p, w, t, q, v, true);
        width = widths(p, w, t, v, gaps);
        outside = width.minCoeff() >= -rounding;
        if (outside && (press.array() > 0.0).select(width, 0.0).maxCoeff() <= rounding) break;
        const ContactRows rows(p, w, gaps, false);
        if (solver.solve(rows.W, width - rows.change(move), rows.cones, true, press) != ConeStatus::solved) break;
        step = rows.response * press - move;
        move += step;
        const VecX from = q;
        retract(p.mechanism, from.data(), step.data(), q.data());
    }
    if (!outside) {  // the next step detects the penetration and stops the approach
        q = start;
        begin_rows(p, w, t, q, v, max_rank_near(w));
        project_position(p, w, t, q, v, true);
        width = widths(p, w, t, v, gaps);
    }
    std::vector<char> touch = closed;
    for (size_t k = 0; k < gaps.size(); ++k) touch[gaps[k]] = std::abs(width[k]) <= rounding;
    set_contacts(p, w, touch, modes);
    return begin_rows(p, w, t, q, v, max_rank_near(w));
}

}  // namespace pn
