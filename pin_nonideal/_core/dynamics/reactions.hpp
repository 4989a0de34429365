// Reactions: what joints, anchors and contacts carry in the motion at hand, ideal and nonideal forces included. They are
// made when first asked for after a motion, and kept until the next.
#pragma once

#include "dynamics/workspace.hpp"

namespace pn {

const Reactions& reactions(const Program& p, Workspace& w);

// Wrench that crosses a joint onto its child body, [force; moment about the joint's origin], world axes; and the one of
// an anchor on the body of frame 1, about the anchor's point.
Force joint_wrench(const Program& p, Workspace& w, int joint);
Force anchor_wrench(const Program& p, Workspace& w, int block);
// All that passes from the one body of an anchor or contact to the other, its friction included, about the origin of
// frame 1.
Force carried_wrench(const Program& p, Workspace& w, int block);

}  // namespace pn
