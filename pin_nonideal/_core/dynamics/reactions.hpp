// Reactions: loads of joints, anchors and contacts in the current motion, including ideal and nonideal forces. Reactions are
// computed on first access and cached until the next motion.
#pragma once

#include "constraints/pull_feasibility.hpp"
#include "dynamics/workspace.hpp"

namespace pn {

const Reactions& reactions(const Program& p, Workspace& w);

// Check if unilateral contacts may share a load. Then the motion determines the set of contacts with zero load.
inline bool shares_contact_loads(const Program& p, const Workspace& w) { return !p.gaps.empty() && w.now.rows.redundant; }

// List all possible zero-load sets of contacts that share loads: per gap, true if its load is zero. Empty if there are too
// many sets.
std::vector<std::vector<char>> zero_load_sets(const Program& p, const Workspace& w);

// Freezes the zero-load set of the current motion during its lifetime. Loads are linear in the motion for a fixed set.
class FrozenZeroLoads {
public:
    FrozenZeroLoads(const Program& p, Workspace& w) : r_(w.now.reactions) {
        was_frozen_ = r_.is_zero_load_set_frozen || !shares_contact_loads(p, w);
        if (was_frozen_) return;
        reactions(p, w);
        hold(true);
    }
    // Freeze the given set of contacts.
    FrozenZeroLoads(Workspace& w, const std::vector<char>& has_zero_load) : r_(w.now.reactions), was_frozen_(false) {
        r_.has_zero_load = has_zero_load;
        hold(true);
    }
    ~FrozenZeroLoads() {
        if (!was_frozen_) hold(false);
    }
    FrozenZeroLoads(const FrozenZeroLoads&) = delete;
    FrozenZeroLoads& operator=(const FrozenZeroLoads&) = delete;

private:
    void hold(bool on) {
        r_.is_zero_load_set_frozen = on;
        r_.current = false;
    }
    Reactions& r_;
    bool was_frozen_ = false;  // frozen by another object, or no contacts share a load
};

// Releases a frozen zero-load set during its lifetime: each motion determines its own set.
class ReleasedZeroLoads {
public:
    explicit ReleasedZeroLoads(Workspace& w)
        : r_(w.now.reactions), was_frozen_(r_.is_zero_load_set_frozen), kept_(r_.has_zero_load) {
        r_.is_zero_load_set_frozen = r_.current = false;
    }
    ~ReleasedZeroLoads() {
        r_.is_zero_load_set_frozen = was_frozen_;
        if (was_frozen_) r_.has_zero_load = kept_;
        r_.current = false;
    }
    ReleasedZeroLoads(const ReleasedZeroLoads&) = delete;
    ReleasedZeroLoads& operator=(const ReleasedZeroLoads&) = delete;

private:
    Reactions& r_;
    const bool was_frozen_;
    const std::vector<char> kept_;
};

// Normal force of a contact or wheel with minimum-norm shares. contact_pull_margin also checks if this contact and the
// contacts that share its load can all be in compression. `contact` indexes Program::contacts.
double normal_force(const Program& p, Workspace& w, int contact);
PullMargin contact_pull_margin(const Program& p, Workspace& w, int contact);

// Sums of the forces on the bodies of each subtree whose bodies share a reference point, except those that act inside tree
// joints. No row may be in use.
void sum_subtree_forces(const Program& p, Workspace& w, std::vector<Force>& body);

// Wrench of a joint on its child body, [force; moment about the joint's origin], world axes. anchor_wrench: wrench of
// an anchor on the body of frame 1, about the anchor's point.
Force joint_wrench(const Program& p, Workspace& w, int joint);
Force anchor_wrench(const Program& p, Workspace& w, int block);
// Total wrench between the two bodies of an anchor or contact, including its friction, about the origin of frame 1.
Force carried_wrench(const Program& p, Workspace& w, int block);

}  // namespace pn
