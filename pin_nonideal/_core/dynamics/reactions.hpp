// Reactions: loads of joints, anchors and contacts in the current motion, including ideal and nonideal forces. They are
// computed on first access and cached until the next motion.
#pragma once

#include "constraints/pull_feasibility.hpp"
#include "dynamics/workspace.hpp"

namespace pn {

const Reactions& reactions(const Program& p, Workspace& w);

// Check if unilateral contacts may share a load. Then the motion determines the set of contacts with zero load.
inline bool shares_pressing(const Program& p, const Workspace& w) { return !p.gaps.empty() && w.now.rows.redundant; }

// List all possible zero-load sets of contacts that share loads: by gap, true if its load is zero. Empty if there are
// too many sets.
std::vector<std::vector<char>> load_pieces(const Program& p, const Workspace& w);

// Freezes the zero-load set of the current motion during its lifetime. Loads are linear in the motion for a fixed set.
class HeldPiece {
public:
    HeldPiece(const Program& p, Workspace& w) : r_(w.now.reactions) {
        held_ = r_.holds_unloaded || !shares_pressing(p, w);
        if (held_) return;
        reactions(p, w);
        hold(true);
    }
    // Freeze the given set of contacts.
    HeldPiece(Workspace& w, const std::vector<char>& unloaded) : r_(w.now.reactions), held_(false) {
        r_.unloaded = unloaded;
        hold(true);
    }
    ~HeldPiece() {
        if (!held_) hold(false);
    }
    HeldPiece(const HeldPiece&) = delete;
    HeldPiece& operator=(const HeldPiece&) = delete;

private:
    void hold(bool on) {
        r_.holds_unloaded = on;
        r_.current = false;
    }
    Reactions& r_;
    bool held_ = false;  // frozen by another object, or no contacts share a load
};

// Releases a frozen zero-load set during its lifetime: each motion determines its own set.
class FreeLoads {
public:
    explicit FreeLoads(Workspace& w) : r_(w.now.reactions), held_(r_.holds_unloaded), kept_(r_.unloaded) {
        r_.holds_unloaded = r_.current = false;
    }
    ~FreeLoads() {
        r_.holds_unloaded = held_;
        if (held_) r_.unloaded = kept_;
        r_.current = false;
    }
    FreeLoads(const FreeLoads&) = delete;
    FreeLoads& operator=(const FreeLoads&) = delete;

private:
    Reactions& r_;
    const bool held_;
    const std::vector<char> kept_;
};

// Normal force of a contact or wheel with minimum-norm shares. contact_press also checks if this contact and the
// contacts that share its load can all be in compression. `contact` indexes Program::contacts.
double normal_force(const Program& p, Workspace& w, int contact);
Press contact_press(const Program& p, Workspace& w, int contact);

// Wrench of a joint on its child body, [force; moment about the joint's origin], world axes. anchor_wrench: wrench of
// an anchor on the body of frame 1, about the anchor's point.
Force joint_wrench(const Program& p, Workspace& w, int joint);
Force anchor_wrench(const Program& p, Workspace& w, int block);
// Total wrench between the two bodies of an anchor or contact, including its friction, about the origin of frame 1.
Force carried_wrench(const Program& p, Workspace& w, int block);

}  // namespace pn
