// Friction elements that share loads in a time step. Constraints join them, and some of their forces do not move the
// bodies: which forces the elements take is then a convention, and their limits by loads depend on it.
#pragma once

#include <vector>

#include "complementarity/least_norm_friction.hpp"

namespace pn {

struct SharedFrictionParameters {
    // Pivot of the response of unit forces, relative to its diagonal, below which forces depend on each other.
    double dependent_pivot = 1e-10;
};

class SharedFriction {
public:
    using Parameters = SharedFrictionParameters;
    static constexpr Parameters parameters{};
    using Responses = Eigen::Ref<const MatX, 0, Eigen::OuterStride<>>;

    struct Element {
        int row, dim;
        double limit, middle;  // as in FrictionLimits
    };

    // Check if some forces of the rows do not move the bodies, with the response W to forces of all rows.
    static bool are_dependent(const Responses& W, const std::vector<int>& rows);
    // Replace the forces of elements that stick by the forces of least norm with the same motion.
    void share(const Responses& W, const std::vector<Element>& sticking, VecX& force);
    // Remove the slip of the rows that constraints prevent. Each row must respond to its force. This slip arises because
    // the velocity of the start does not satisfy the constraints at the step's middle. No force changes this slip, and
    // friction may grow against it without end.
    static void drop_prevented_slip(const Responses& W, const std::vector<int>& rows, VecX& slips);

private:
    LeastNormFriction least_norm_;
    FrictionLimits limits_;
    VecX force_;
    std::vector<int> rows_, dims_;
};

}  // namespace pn
