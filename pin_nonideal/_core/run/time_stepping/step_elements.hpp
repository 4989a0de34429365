// Contacts and dry friction that take part in a time step, as elements of a cone problem.
//
// A contact has one row along its normal and the rows of its sliding, in Coulomb's cone. Other dry friction has a box
// or a disk whose limits may follow loads. The rows of the elements lie in sequence.
#pragma once

#include <algorithm>
#include <vector>

#include "complementarity/cone/problem.hpp"
#include "dynamics/tree_blocks.hpp"
#include "math/anderson.hpp"
#include "run/time_stepping/mean_velocity.hpp"

namespace pn {

struct StepElementsParameters {
    double load_tolerance = 1e-12;  // change of limits that counts as rounding error, relative to the largest limit
    // Maximum ratio of successive changes of limits in convergent passes. Larger ratios occur if the cones do not determine
    // a force component, such as the direction of slow slip.
    double max_load_contraction = 0.5;
    // Fraction of the limits that elements at rest use if their limits do not converge.
    double kept_limit = 0.9;
};

class StepElements {
public:
    using Parameters = StepElementsParameters;
    static constexpr Parameters parameters{};

    struct Part {
        int gap = -1;          // gap of a contact, -1 if none
        int element = -1;      // friction element: sliding of the contact, or a box
        // Restitution times the closing rate of the gap, at most 0. A contact with a load in the last step does not
        // bounce: turning normals and other forces close its gap anew in each step.
        double approach = 0.0;
        double middle = 0.0;   // middle of the limits of a box with one direction
        bool rests = false;    // the element sticks at the step's start
        bool strikes = false;  // the contact was open at the step's start
    };

    std::vector<StepRow> rows;
    std::vector<Part> parts;         // per element
    std::vector<ConeElement> cones;  // per element

    explicit StepElements(const Program& p);

    // Collect the elements of the contacts `touching` with their sliding, then other dry friction. The step starts with
    // the given closed contacts and modes, and contacts are evaluated at the velocity of its start. `loaded`: blocks of the
    // contacts with a load in the last step, ascending.
    void gather(const Program& p, Workspace& w, const std::vector<int>& touching, const std::vector<char>& closed,
                const std::vector<Mode>& modes, const std::vector<int>& loaded, const MeanVelocity& mean);
    // Check if a contact was open at the step's start.
    bool strike() const {
        return std::any_of(parts.begin(), parts.end(), [](const Part& part) { return part.strikes; });
    }
    // Update the coefficients of contacts to the velocity of the workspace.
    void move(const Program& p, const Workspace& w);
    // Check if a limit of dry friction follows a load. The loads must then have minimum norm, because limits of other
    // loads may not converge.
    bool limits_follow_loads(const Program& p) const;
    // Begin passes of limits_settle.
    void begin_passes() {
        last_change_ = HUGE_VAL;
        loads_.restart();
    }
    // Update the limits of dry friction to the loads of the current motion. Return true if they have converged, or if
    // they change by at most `allowed` and do not converge.
    bool limits_settle(const Program& p, Workspace& w, double t, const MeanVelocity& mean, double allowed);
    // Replace the limits of dry friction by the next iterate after the limits before their update.
    void accelerate_limits();
    // Check if static friction holds an element that kinetic friction may not hold.
    bool may_give_way(const Program& p) const;
    // Replace static by kinetic friction where the forces f are at their limit, up to `clear`, and the element slips
    // faster than `still`. Return true if it does.
    bool give_way(const Program& p, const Workspace& w, const VecX& f, const VecX& slips, double clear, double still);
    // Return the force that is left to the limit of an element with forces f from row `at` on.
    double limit_left(size_t e, int at, const VecX& f) const;
    // Reduce the limits of dry friction to a fraction of their values.
    void reduce_limits();
    // Set the limits of dry friction to the loads of the current motion. Return true if the forces f are within them.
    bool limits_hold(const Program& p, Workspace& w, double t, const MeanVelocity& mean, const VecX& f);
    // Write the middles of the limits into f. Boxes of the cone problem are centered at zero force.
    void middles(VecX& f) const;
    // Friction elements that belong to no unilateral contact.
    const std::vector<int>& outside_contacts() const { return outside_contacts_; }

private:
    SlipLimits limits(const Program& p, Workspace& w, double t, const MeanVelocity& mean, size_t e) const;
    double coefficient(const Program& p, const Workspace& w, const Part& part) const;
    void add(const Program& p, const Part& part, int block, int kept, const ConeElement& cone);

    std::vector<int> outside_contacts_;
    std::vector<int> rubbing_;  // friction elements that take part, except the sliding of contacts
    double last_change_ = 0.0;       // change of the limits between two passes
    std::vector<double> from_, to_;  // sizes and middles of the limits before and after the update
    AndersonAcceleration loads_;
};

}  // namespace pn
