#include "contact/queries.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "constraints/redundancy.hpp"
#include "dynamics/reactions.hpp"
#include "math/tolerances.hpp"

namespace pn {

// Gap acceleration, and the sum of the magnitudes of its terms.
static std::pair<double, double> rate_of_rate(const Program& p, const Workspace& w, int gap) {
    const Block& block = p.blocks[p.gaps[gap].block];
    const double bias = w.now.values[p.gaps[gap].block].bias[block.kept[0]];
    double sum = bias, size = std::abs(bias);
    const double* A = w.now.A.data() + block.offset;
    for (size_t l = 0; l < block.support().size(); ++l) {
        const double term = A[l] * w.now.a[block.support()[l]];
        sum += term;
        size += std::abs(term);
    }
    return {sum, size};
}

double gap_acceleration(const Program& p, const Workspace& w, int gap) { return rate_of_rate(p, w, gap).first; }

double acceleration_rounding(const Program& p, const Workspace& w, int gap) {
    return contact_query_parameters.sum_rounding * (rate_of_rate(p, w, gap).second + p.mechanism.gravity.norm());
}

namespace {

struct Line { Vec3 point, along; };

// Line of action of a geometric row, as a force on the body with the higher number.
Line line_of(const Program& p, const Workspace& w, int block, int row) {
    const Wrench& unit = w.now.values[block].wrench[row];
    return {unit.point, p.blocks[block].joint1 > p.blocks[block].joint2 ? unit.force : -unit.force};
}

bool rubs_the_same(const Friction& a, const Friction& b) {
    return a.mu == b.mu && a.constant == b.constant && a.radius == b.radius && a.axial_radius == b.axial_radius &&
           a.inverse_span == b.inverse_span && a.static_ratio == b.static_ratio &&
           a.stribeck_velocity == b.stribeck_velocity && a.dim == b.dim && !a.user_limit && !b.user_limit;
}

// Check if two contacts have equal friction and restitution. The runs of a batch may have other values than the scene.
bool rub_and_bounce_the_same(const Program& p, const Gap& a, const Gap& b) {
    return a.restitution == b.restitution && (a.sliding < 0) == (b.sliding < 0) &&
           std::equal(a.elements.begin(), a.elements.end(), b.elements.begin(), b.elements.end(), [&](int e, int other) {
               return rubs_the_same(p.frictions[e], p.frictions[other]);
           });
}

}  // namespace

bool same_bodies(const Program& p, int gap, int other) {
    return p.bodies_of_gap[gap] == p.bodies_of_gap[other];
}

bool are_duplicates(const Program& p, int gap, int other) {
    const Gap &a = p.gaps[gap], &b = p.gaps[other];
    return a.same_geometry_as == b.same_geometry_as && (gap == other || rub_and_bounce_the_same(p, a, b));
}

bool coincide(const Program& p, const Workspace& w, int gap, int other) {
    if (!same_bodies(p, gap, other)) return false;
    const Gap &a = p.gaps[gap], &b = p.gaps[other];
    if (are_duplicates(p, gap, other)) return true;
    if (!w.now.values[a.block].geometric || !w.now.values[b.block].geometric) return false;
    if (!rub_and_bounce_the_same(p, a, b)) return false;
    const Line one = line_of(p, w, a.block, 0), two = line_of(p, w, b.block, 0);
    const double size = 1.0 + one.point.norm();
    const double tolerance = contact_query_parameters.coincidence_tolerance;
    if ((one.along - two.along).norm() > tolerance) return false;
    if ((one.point - two.point).cross(one.along).norm() > tolerance * size) return false;
    if (a.sliding < 0) return true;
    const Friction &rubs = p.frictions[a.sliding], &rubs_too = p.frictions[b.sliding];
    const Vec3 apart = w.now.values[rubs.block].wrench[0].point - w.now.values[rubs_too.block].wrench[0].point;
    return apart.norm() <= tolerance * size;
}

void remove_coincident(const Program& p, const Workspace& w, std::vector<int>& list, const Precedence& precedes) {
    std::sort(list.begin(), list.end(), [&](int i, int j) {
        return std::make_pair(p.bodies_of_gap[i], i) < std::make_pair(p.bodies_of_gap[j], j);
    });
    size_t left = 0, first = 0;  // gaps kept, and the first of them between the same bodies
    for (int gap : list) {
        if (left > 0 && !same_bodies(p, list[left - 1], gap)) first = left;
        const auto begin = list.begin() + static_cast<std::ptrdiff_t>(first);
        const auto end = list.begin() + static_cast<std::ptrdiff_t>(left);
        const auto same = std::find_if(begin, end, [&](int other) { return coincide(p, w, gap, other); });
        if (same == end) list[left++] = gap;
        else if (precedes(gap, *same)) *same = gap;
    }
    list.resize(left);
    std::sort(list.begin(), list.end());
}

bool opens_later(const Program& p, const Workspace& w, int gap, int other) {
    const auto bias = [&](int i) { return w.now.values[p.gaps[i].block].bias[p.blocks[p.gaps[i].block].kept[0]]; };
    const double scale = std::abs(bias(gap)) + std::abs(bias(other)) + p.mechanism.gravity.norm();
    return bias(gap) < bias(other) - min_bias_jump * scale;
}

double load(const Program& p, Workspace& w, int gap) {
    return reactions(p, w).lam[p.blocks[p.gaps[gap].block].row];
}

double load_rounding(const Program& p, const Workspace& w, int gap) {
    const double scale = w.now.rows.scale[p.blocks[p.gaps[gap].block].row];  // squared: mass that the row moves
    return contact_query_parameters.sum_rounding * scale * scale *
           (w.now.a.cwiseAbs().maxCoeff() + p.mechanism.gravity.norm());
}

int pulling_contact(const Program& p, Workspace& w) {
    const Reactions& r = reactions(p, w);
    if (r.loads_are_feasible && w.now.rows.redundant) return -1;
    VecX lam = r.lam;
    if (w.now.rows.redundant) share_multipliers(p.blocks, w.now.B, p.described, w.now.rows, w.now.lam, lam);
    int pulling = -1;
    double most = 0.0;
    for (int i = 0; i < static_cast<int>(p.gaps.size()); ++i) {
        if (!w.state.closed[i] || is_bare(p, i)) continue;
        const double pull = -lam[p.blocks[p.gaps[i].block].row] / load_rounding(p, w, i);
        if (!(pull > 1.0) || pull <= most) continue;
        most = pull;
        pulling = i;
    }
    return pulling;
}

}  // namespace pn
