// Guard against speeds that grow without bound: a controller or a law drives a motion instead of damping it.
#pragma once

#include "run/output/checkpoint.hpp"
#include "run/options.hpp"

namespace pn {

class GrowthGuard {
public:
    GrowthGuard(System& system, Progress& progress, const Options& options, const Recording& out);

    // Check the growth after an accepted step. Throw a Failure if the largest speed has grown over many decades. The
    // growth is exponential, or a power of time in thousands of steps. The Failure has the dof, its source (0
    // actuation, 1 applied forces, 2 laws) and the rate of growth [1/s]. A run with max_steps is not limited.
    void look();

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
