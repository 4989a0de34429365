#include "contact/far_gaps.hpp"

#include <algorithm>
#include <cmath>

#include "contact/gaps.hpp"

namespace pn {

namespace {

// Sums of coordinates in gaps and moves round to this part of what stands in them.
constexpr double sum_rounding = 1e-12;

// How far what belongs to a contact reaches from the origins of its bodies; infinite where nothing is known of its gap.
std::pair<double, double> arms(const Kind& kind) {
    // A plane has no end: its turning moves what is far from it without bound.
    const auto plane = [](const Frame& frame) { return frame.joint == 0 ? 0.0 : HUGE_VAL; };
    if (const auto* c = std::get_if<ContactRow>(&kind)) return {c->frame1.p.norm(), plane(c->frame2)};
    if (const auto* e = std::get_if<EllipsoidRow>(&kind)) return {e->frame1.p.norm() + e->reach(), plane(e->frame2)};
    if (const auto* c = std::get_if<CapsulesRow>(&kind))
        return {c->frame1.p.norm() + c->half1, c->frame2.p.norm() + c->half2};
    if (const auto* b = std::get_if<BoxRow>(&kind)) return {b->frame1.p.norm(), b->frame2.p.norm() + b->half.norm()};
    if (const auto* h = std::get_if<HullRow>(&kind)) return {h->frame1.p.norm(), h->frame2.p.norm() + h->solid.reach};
    if (const auto* r = std::get_if<RevolvedRow>(&kind))
        return {r->frame1.p.norm(), r->frame2.p.norm() + r->solid.reach};
    if (const auto* l = std::get_if<LineRow>(&kind))
        return {l->frame1.p.norm() + l->half1, l->frame2.p.norm() + l->solid.reach};
    if (const auto* r = std::get_if<RimRow>(&kind))
        return {r->frame1.p.norm() + r->rim, r->frame2.p.norm() + r->solid.reach};
    return {HUGE_VAL, HUGE_VAL};
}

double distance_squared(const Mat3& a, const Mat3& b) {
    double sum = 0.0;
    for (int k = 0; k < 3; ++k) sum += (a.c[k] - b.c[k]).squaredNorm();
    return sum;
}

Vec3 origin_of(const Body& body) { return body.ref + body.p; }

}  // namespace

FarGaps::FarGaps(const Program& p) {
    for (int i = 0; i < static_cast<int>(p.gaps.size()); ++i) {
        if (is_bare(p, i)) continue;
        const Block& block = p.blocks[p.gaps[i].block];
        const auto [arm1, arm2] = arms(block.kind);
        const bool bounded = arm1 < HUGE_VAL && arm2 < HUGE_VAL;
        // One pair for all of which nothing is known.
        const int joint1 = bounded ? block.joint1 : -1, joint2 = bounded ? block.joint2 : -1;
        auto pair = std::find_if(pairs_.begin(), pairs_.end(), [&](const Pair& known) {
            return known.sides[0].joint == joint1 && known.sides[1].joint == joint2;
        });
        if (pair == pairs_.end()) {
            pair = pairs_.insert(pairs_.end(), Pair());
            pair->sides[0].joint = joint1;
            pair->sides[1].joint = joint2;
        }
        pair->sides[0].arm = std::max(pair->sides[0].arm, arm1);
        pair->sides[1].arm = std::max(pair->sides[1].arm, arm2);
        pair->gaps.push_back({i});
    }
}

// By how much its gaps may have changed since all were looked at.
double FarGaps::move(const Workspace& w, const Pair& pair) {
    double moved = 0.0;
    for (const Side& side : pair.sides) {
        if (side.joint < 0) return HUGE_VAL;
        if (side.joint == 0) continue;
        const Body& body = w.now.terms.body[side.joint];
        const Vec3 origin = origin_of(body);
        // A turn by an angle moves what stands off its axis by 2 sin(angle / 2) of the distance.
        const double turned = std::sqrt(0.5 * distance_squared(body.R, side.R));
        moved += (origin - side.origin).norm() + turned * side.arm + sum_rounding * (origin.norm() + side.arm);
    }
    return moved;
}

void FarGaps::take(const Workspace& w, Pair& pair) {
    pair.looks = 0;
    pair.known = pair.sides[0].joint >= 0;
    for (Side& side : pair.sides) {
        if (side.joint <= 0) continue;
        const Body& body = w.now.terms.body[side.joint];
        side.origin = origin_of(body);
        side.R = body.R;
    }
}

}  // namespace pn
