// Speeds that grow without bound: a controller, or a law, that drives a motion instead of damping it.
#pragma once

#include "run/output/checkpoint.hpp"
#include "run/options.hpp"

namespace pn {

class GrowthGuard {
public:
    GrowthGuard(System& system, Progress& progress, const Options& options, const Recording& out);

    // After an accepted step. Throws a Failure where the largest speed has grown over many decades, exponentially, or by a
    // power of time in thousands of steps, with its dof, its source (0 the actuation, 1 given forces, 2 laws) and the rate
    // of growth [1/s]. A run with max_steps may grow as it likes.
    void look();

private:
    void judge();
    bool is_exponential() const;
    bool is_costly() const;
    // Mean rate of growth over the decades up to the k-th [1/s].
    double growth(size_t k) const;
    int largest_source() const;

    System& system_;
    Progress& progress_;
    const Options& options_;
    const Recording& out_;
};

}  // namespace pn
