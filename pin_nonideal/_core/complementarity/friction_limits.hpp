// Limits of several friction forces, on arrays.
#pragma once

#include "math/spatial.hpp"

namespace pn {

// Limits of friction forces: those of an element lie within `size` of `middle`, which is given by row and is zero but for
// elements of one direction that do not rub alike forward and backward.
struct FrictionLimits {
    VecX size, middle;

    FrictionLimits() = default;
    FrictionLimits(int elements, int rows) : size(VecX::Zero(elements)), middle(VecX::Zero(rows)) {}
    double operator[](Eigen::Index element) const { return size[element]; }
};

}  // namespace pn
