// Guard against speeds that grow without bound: a controller or a law drives a motion instead of damping it.
#pragma once

#include "run/output/checkpoint.hpp"
#include "run/options.hpp"

namespace pn {

struct GrowthGuardParameters {
    // Speed [rad/s or m/s] from which every decade is recorded. Smaller speeds are ordinary.
    double min_recorded_speed = 1.0;
    double decade = 10.0;  // ratio of two recorded speeds
    // Decades in each half of a growth. Exponential growth takes equal time for both halves. Under a constant force, or
    // in a motion polynomial in time, the second half takes much longer. The second half takes much less near a singular
    // position, or under a force that grows with a power of the speed. Such runs end by themselves as their steps shrink.
    size_t half = 3;
    // Least and largest ratio of the rates of growth of the two halves that counts as exponential growth.
    double as_fast = 0.8, much_faster = 100.0;
    // A chaotic motion with a source of energy grows with a power of time. The last decade of such a growth takes at least
    // this number of steps.
    long min_decade_steps = 1000;
    // Each of its decades takes longer than the one before, on average less than this many times as long. Under a
    // constant force a decade takes ten times as long, and near a singular position it is shorter.
    double longer = 5.0;
    // Maximum growth in one fixed step that is attributed to the motion. Faster growth comes from the method: the step
    // is too long, and the motion overflows.
    double growth_in_step = 0.1;
    // Speed [rad/s or m/s] that no mechanism has. A run of fixed steps ends at this speed, before its motion
    // overflows.
    double impossible_speed = 1e12;
};

class GrowthGuard {
public:
    using Parameters = GrowthGuardParameters;
    static constexpr Parameters parameters{};

    GrowthGuard(System& system, Progress& progress, const Options& options, const Recording& out);

    // Check the growth after an accepted step. Throw a Failure if the largest speed has grown over many decades. The
    // growth is exponential, or a power of time in thousands of steps. The Failure has the dof, its source (0
    // actuation, 1 applied forces, 2 laws) and the rate of growth [1/s]. A run with max_steps is not limited.
    void check_step();

private:
    void judge();
    bool is_exponential() const;
    bool is_costly() const;
    // Return the mean rate of growth over the decades up to the k-th [1/s].
    double growth(size_t k) const;
    int largest_source() const;

    System& system_;
    Progress& progress_;
    const Options& options_;
    const Recording& out_;
};

}  // namespace pn
