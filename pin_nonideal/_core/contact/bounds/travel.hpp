// Maximum travel of bodies since the start of a run, from joint speeds only. A gap wider than the travel of its two
// bodies is still open and is not evaluated. The cost per step does not grow with the number of contacts.
#pragma once

#include <vector>

#include "dynamics/program.hpp"

namespace pn {

// Travel data that lasts from step to step. Travel of a body bounds the path length [m] of its contact points. Travel of a
// joint is in the joint's unit, and rotation in radians.
struct TravelState {
    std::vector<double> body, joint, turn;  // per joint: travel of its body, of the joint, rotation of its body
    double scene = 0.0;                     // sum over the steps of the largest body travel
    // Distance [m] of points that a joint moves from its origin. Valid until sliding joints travel beyond slid_until.
    std::vector<double> lever, slid_until;
    bool placed = false;  // lever and slid_until are computed
    // Per joint, since the last sum over bodies: translation and rotation of its body relative to its parent.
    std::vector<double> slid, turned;
    // Travel over the current step. Entries of bodies are valid only if `summed`.
    std::vector<double> body_step, joint_step, turn_step, slid_step, turned_step;
    double scene_step = 0.0;
    double max_total = 0.0, max_step = 0.0;  // upper bounds of the scene's travel: total, and over the step
    bool summed = false;

    // Add the travel of the step to the totals.
    void add_step();
    // Add the travel of bodies over the current step to the totals.
    void add_bodies();
};

struct TravelBoundParameters {
    // Safety factor of the travel, for the moves of projections.
    double travel_factor = 2.0;
    // Sliding joints get a margin before levers are recomputed: this fraction of the distance, plus this many steps.
    double room_ahead = 0.5, steps_ahead = 4.0;
    // Factor that makes a floating-point sum an upper bound.
    double rounded_up = 1.0 + 0x1p-51;
    // Factor that makes a floating-point sum over all joints an upper bound.
    double joints_rounded_up = 1.0 + 1e-12;
    // Minimum lever of a joint with a limit: one unit of the joint counts as one meter of its body.
    double lever_of_stop = 1.0;
};

class TravelBound {
public:
    using Parameters = TravelBoundParameters;
    static constexpr Parameters parameters{};

    explicit TravelBound(const Program& p);

    void size(TravelState& travel) const;
    // Compute the travel of joints and the upper bound of the scene's travel over a step of length h. `speed` is the
    // largest |v| of each dof. The bodies are at one end of the step. `sum_up` computes the travel of bodies, total and
    // over the step.
    void step(const Terms& terms, const VecX& speed, double h, TravelState& travel) const;
    void sum_up(TravelState& travel) const;

    // Bodies or joint that change a gap.
    struct Pair {
        int first = 0, second = 0, joint = 0;
        double reach = 0.0;  // extent of the first body's geometry from its frame [m]
        bool plane_rotates = false;  // the plane of the second body may rotate: speeds on it grow with distance
        bool is_unknown = false;  // user function
    };
    const Pair& pair(int gap) const { return pairs_[gap]; }
    // Maximum change of a gap for the travel since its last evaluation, with the distance of its bodies at that time.
    static double max_change(const Pair& pair, double path_length, double turn, double distance) {
        return pair.plane_rotates ? path_length + turn * (distance + path_length) : path_length;
    }
    // Scene travel over which a gap may change by `width`. Zero for a rotating plane, whose travel depends on the
    // distance.
    static double min_scene_travel(const Pair& pair, double width) {
        return pair.plane_rotates ? 0.0 : pair.first == 0 || pair.second == 0 ? width : 0.5 * width;
    }
    // Distance of the bodies of a gap, needed for rotating planes only.
    double distance(const Terms& terms, int gap) const;
    double path_length(const TravelState& travel, int gap) const {
        const Pair& pair = pairs_[gap];
        return travel.body[pair.first] + travel.body[pair.second] + travel.joint[pair.joint];
    }
    double step_path_length(const TravelState& travel, int gap) const {
        const Pair& pair = pairs_[gap];
        return travel.body_step[pair.first] + travel.body_step[pair.second] + travel.joint_step[pair.joint];
    }

private:
    struct Moved {  // joint that moves contacts
        int joint, parent, iv, nv;
        JointKind kind;
        double slide, turn;  // translation and rotation of its body relative to the parent per unit velocity, for one dof
        bool drifts;         // moves its origin relative to a body that may rotate
    };
    struct Speeds { double slide, turn; };
    static Speeds speeds(const Moved& moved, const VecX& speed);
    void set_levers(const Terms& terms, TravelState& travel) const;
    void spread(const std::vector<double>& slid, const std::vector<double>& turned, TravelState& travel) const;

    const Program& p;
    std::vector<Moved> moved_;    // each after its parent
    bool drift_ = false;          // some joint drifts
    std::vector<double> extent_;  // per joint: distance of contact points of its body from its origin [m]
    std::vector<Pair> pairs_;     // per gap
};

}  // namespace pn
