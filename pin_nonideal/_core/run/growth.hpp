// Speeds that grow without bound: a controller, or a law, that feeds what it should damp.
#pragma once

#include "run/checkpoint.hpp"
#include "run/options.hpp"

namespace pn {

class GrowthGuard {
public:
    GrowthGuard(System& system, Progress& progress, const Options& options);

    // After an accepted step. Throws a Failure where the largest speed has grown exponentially over many decades, with its
    // dof, what feeds it (0 the actuation, 1 given forces, 2 laws) and the rate of growth [1/s]. A run with max_steps may grow as it likes.
    void look();

private:
    void judge();
    int largest_source() const;

    System& system_;
    Progress& progress_;
    const Options& options_;
};

}  // namespace pn
