// Limits of several friction forces, on arrays.
#pragma once

#include "math/spatial.hpp"

namespace pn {

// Limits of friction forces. The force of an element lies within `size` of `middle`. `middle` is given per row. The middle
// is zero except for elements of one direction with different limits forward and backward.
struct FrictionLimits {
    VecX size, middle;

    FrictionLimits() = default;
    FrictionLimits(int elements, int rows) : size(VecX::Zero(elements)), middle(VecX::Zero(rows)) {}
    double operator[](Eigen::Index element) const { return size[element]; }
};

}  // namespace pn
