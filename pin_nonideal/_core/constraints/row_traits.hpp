// Traits that a kind declares beside its formulas.
#pragma once

namespace pn {

// Role of the rows of a constraint in a scene.
enum class Role {
    constraint,
    contact,   // a constraint with a multiplier that should not be negative
    direction  // slip direction of friction, with a slip velocity as rate
};

// A number, frame or vector of a kind, with its name in Python.
template <class Kind, class Value>
struct Field {
    const char* name;
    Value Kind::*member;
};
template <class Kind, class Value>
Field(const char*, Value Kind::*) -> Field<Kind, Value>;

// Display of a constraint in a replay.
enum class DisplayKind {
    nothing,
    anchor,   // two tied frames, and the force on frame 1 by components in the axes of frame 2
    rod,      // two tied frames, and the force along their line
    contact,  // a ring, cone and mark, and the force, at the contact point
    rolling,  // the force at the contact of a sphere or disk with a plane
    edge,     // the force at a frame, along its axis
    drive,    // the generalized force on a joint
    gear      // the generalized forces on two joints
};

// Bases of kinds. A base holds the properties that its kinds share by definition, and safe defaults of other
// properties. A kind with another value declares the property again.

// Base of constraints.
struct ConstraintKind {
    static constexpr Role role = Role::constraint;
    static constexpr bool constant_A = false, comparable_rows = false;
};

// Base of gaps: one row with a position, and the contact force as multiplier.
struct GapKind {
    static constexpr Role role = Role::contact;
    static constexpr bool constant_A = false, affine_rate = true, comparable_rows = false;
    static constexpr int pressing = 0;
    static constexpr DisplayKind shown = DisplayKind::contact;

    int size() const { return 1; }
    bool is_holonomic(int) const { return true; }
    bool moves_in_time() const { return false; }
};

// Base of gaps between a shape on body 1 and the plane of frame 2.
struct PlaneGap : GapKind {};

// Base of gaps between a shape on each body. Shape 1 is a point, segment or disk, or a solid of revolution. The radii of
// both shapes are part of the gap.
struct ShapeGap : GapKind {};

// Base of friction directions between two frames. The rates of these rows are slip velocities, and the rows hold no
// position.
struct SlipDirections {
    static constexpr Role role = Role::direction;
    static constexpr bool constant_A = false, affine_rate = true, comparable_rows = false;
    static constexpr DisplayKind shown = DisplayKind::nothing;

    bool is_holonomic(int) const { return false; }
    bool moves_in_time() const { return false; }
    template <class Sides, class Out>
    void residual(const Sides&, Out&) const {}
};

// Base of the two directions along the plane of a contact.
struct ContactSlip : SlipDirections {
    int size() const { return 2; }
};

}  // namespace pn
