// What a replay shows of a constraint.
#pragma once

namespace pn {

enum class Shown {
    nothing,
    anchor,   // a tie of two frames; the force on frame 1, by components in the axes of frame 2
    rod,      // a tie of two frames; the force along their line
    contact,  // a mark; the force where a sphere touches a plane
    rolling,  // the force where a sphere or disk touches a plane
    edge,     // the force at a frame, along its axis
    drive,    // the generalized force on a joint
    gear      // the same on two joints
};

}  // namespace pn
