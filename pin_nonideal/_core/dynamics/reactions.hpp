// Reactions: what joints, anchors and contacts carry in the motion at hand, ideal and nonideal forces included. They are
// made when first asked for after a motion, and kept until the next.
#pragma once

#include "constraints/pull_feasibility.hpp"
#include "dynamics/workspace.hpp"

namespace pn {

const Reactions& reactions(const Program& p, Workspace& w);

// Whether contacts that may open share a load: which of them carry nothing depends on the motion then.
inline bool shares_pressing(const Program& p, const Workspace& w) { return !p.gaps.empty() && w.now.rows.redundant; }

// All pieces of the loads of contacts that share them: by contact, whether it carries nothing. None where they would be too
// many.
std::vector<std::vector<char>> load_pieces(const Program& p, const Workspace& w);

// As long as it lives, the contacts that carry nothing in the motion at hand go on to carry nothing: loads are linear in
// the motion, one piece of what they are.
class HeldPiece {
public:
    HeldPiece(const Program& p, Workspace& w) : r_(w.now.reactions) {
        held_ = r_.holds_unloaded || !shares_pressing(p, w);
        if (held_) return;
        reactions(p, w);
        hold(true);
    }
    // Of the contacts told.
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
    bool held_ = false;  // by another, or there is nothing to hold
};

// The other way: loads as the motion has them, though a piece is held.
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

// Normal force of a contact or wheel by the shares of least norm, and whether it and those that it shares a load with
// could press all: `contact` counts Program::contacts.
double normal_force(const Program& p, Workspace& w, int contact);
Press contact_press(const Program& p, Workspace& w, int contact);

// Wrench that crosses a joint onto its child body, [force; moment about the joint's origin], world axes; and the one of
// an anchor on the body of frame 1, about the anchor's point.
Force joint_wrench(const Program& p, Workspace& w, int joint);
Force anchor_wrench(const Program& p, Workspace& w, int block);
// All that passes from the one body of an anchor or contact to the other, its friction included, about the origin of
// frame 1.
Force carried_wrench(const Program& p, Workspace& w, int block);

}  // namespace pn
