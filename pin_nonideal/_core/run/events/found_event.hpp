// Event found inside a step.
#pragma once

namespace pn {

struct FoundEvent {
    enum class Kind {
        rest_or_limit,      // a friction element comes to rest, or a sticking element reaches its limit
        released_together,  // redundant sticking elements begin to slip, including this one
        reversal,           // the slip of an element reverses without coming to rest
        pull,               // a bilateral contact begins to carry tension
        lift,               // a unilateral contact loses its load, or several together have no nonnegative loads
        touch,              // a gap closes
        user,               // a user function crosses zero
    } kind;
    int index;  // index of the friction element, the contact in tension or the gap, -1 for several gaps
    double time;
    bool in_vain = false;  // touch of a gap without load, whose contact had been opened
    bool of_hand_over = false;  // lift at which closed contacts pass to other features

    // Lift of several gaps together.
    static FoundEvent joint_lift(double time) { return {Kind::lift, -1, time}; }
    static FoundEvent hand_over(double time) { return {Kind::lift, -1, time, false, true}; }
    bool changes_modes() const { return kind != Kind::reversal && kind != Kind::pull && kind != Kind::user; }
    bool of_gap() const { return kind == Kind::lift || kind == Kind::touch; }
};

}  // namespace pn
