// What a kind may say of itself beside its formulas.
#pragma once

namespace pn {

// What its rows are to a scene.
enum class Role {
    constraint,
    contact,   // a constraint whose multiplier should press
    direction  // of friction: its rates are slip velocities
};

// A number, frame or vector that it is made of, by the name that Python gives it.
template <class Kind, class Value>
struct Datum {
    const char* name;
    Value Kind::*member;
};
template <class Kind, class Value>
Datum(const char*, Value Kind::*) -> Datum<Kind, Value>;

// What a replay shows of it.
enum class Shown {
    nothing,
    anchor,   // a tie of two frames; the force on frame 1, by components in the axes of frame 2
    rod,      // a tie of two frames; the force along their line
    contact,  // a ring, cone and mark, and the force, where it touches
    rolling,  // the force where a sphere or disk touches a plane
    edge,     // the force at a frame, along its axis
    drive,    // the generalized force on a joint
    gear      // the same on two joints
};

// What directions of friction between two frames have in common: their rates are slip velocities, and nothing is kept.
struct SlipDirections {
    static constexpr Role role = Role::direction;
    static constexpr bool constant_A = false, affine_rate = true, comparable_rows = false;
    static constexpr Shown shown = Shown::nothing;

    bool is_holonomic(int) const { return false; }
    bool moves_in_time() const { return false; }
    template <class Sides, class Out>
    void residual(const Sides&, Out&) const {}
};

}  // namespace pn
