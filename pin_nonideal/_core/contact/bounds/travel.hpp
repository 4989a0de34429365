// How far bodies have come at most since a run began, from the speeds of the joints alone: a gap that was wider than its
// two bodies have come since then is open, and nobody looks at it. What this costs a step does not grow with the contacts.
#pragma once

#include <vector>

#include "dynamics/program.hpp"

namespace pn {

// What lasts from step to step. A way is counted in meters of any point by which a body touches, of a joint by itself in
// its own unit; a turn in radians.
struct Ways {
    std::vector<double> body, joint, turn;  // by joint: of its body, of itself, of its body's turning
    double scene = 0.0;                     // of the body that comes farthest in each step
    // Of points on what a joint moves from its own origin [m], as long as joints that slide have not come farther.
    std::vector<double> lever, slid_until;
    bool placed = false;  // where that is known
    // Of each joint by itself since those of the bodies were summed up: how far its body slid and turned on the one before.
    std::vector<double> slid, turned;
    // Over the step at hand; of bodies only where that was summed up.
    std::vector<double> body_step, joint_step, turn_step, slid_step, turned_step;
    double scene_step = 0.0;
    double most = 0.0, most_step = 0.0;  // no less than the scene's way, so far and over the step
    bool summed = false;

    // The step is taken: its ways count.
    void go_on();
    // Those of bodies over the step at hand.
    void add_bodies();
};

class WayBound {
public:
    explicit WayBound(const Program& p);

    void size(Ways& ways) const;
    // Over a step of length h with the largest |v| of each dof; the bodies stand at one end of it. Ways of joints, and the
    // most that the scene's may be; `sum_up` makes those of the bodies, so far and over the step.
    void step(const Terms& terms, const VecX& speed, double h, Ways& ways) const;
    void sum_up(Ways& ways) const;

    // What a gap hangs on: the ways of two bodies, or of a joint.
    struct Pair {
        int first = 0, second = 0, joint = 0;
        double reach = 0.0;    // of the first from its frame [m]
        bool turns = false;    // with a plane on the second, which may turn: the farther, the faster it comes
        bool unknown = false;  // a function of the user's
    };
    const Pair& pair(int gap) const { return pairs_[gap]; }
    // By how much a gap may have changed, by ways since it was looked at; with the distance of its bodies then.
    static double change(const Pair& pair, double way, double turn, double apart) {
        return pair.turns ? way + turn * (apart + way) : way;
    }
    // The scene's way over which a gap may change so much; none where a plane turns, whose way depends on the distance.
    static double least_way(const Pair& pair, double width) {
        return pair.turns ? 0.0 : pair.first == 0 || pair.second == 0 ? width : 0.5 * width;
    }
    // That distance; asked only where a plane turns.
    double apart(const Terms& terms, int gap) const;
    double way(const Ways& ways, int gap) const {
        const Pair& pair = pairs_[gap];
        return ways.body[pair.first] + ways.body[pair.second] + ways.joint[pair.joint];
    }
    double way_of_step(const Ways& ways, int gap) const {
        const Pair& pair = pairs_[gap];
        return ways.body_step[pair.first] + ways.body_step[pair.second] + ways.joint_step[pair.joint];
    }

private:
    struct Moved {  // a joint that gaps hang on
        int joint, parent, iv, nv;
        JointKind kind;
        double slide, turn;  // of its body against the one before, by a unit of velocity; where it has one dof
        bool drifts;         // moves its origin against a body that may turn
    };
    struct Speeds { double slide, turn; };
    static Speeds speeds(const Moved& moved, const VecX& speed);
    void set_levers(const Terms& terms, Ways& ways) const;
    void spread(const std::vector<double>& slid, const std::vector<double>& turned, Ways& ways) const;

    const Program& p;
    std::vector<Moved> moved_;    // each after its parent
    bool drift_ = false;          // some do
    std::vector<double> extent_;  // by joint: of points by which its body touches, from its origin [m]
    std::vector<Pair> pairs_;     // by gap
};

}  // namespace pn
