// Unit vectors across a slip direction.
#pragma once

#include <cmath>

#include "math/spatial.hpp"

namespace pn {

// One component of a unit vector is at most the root of 1/3.
constexpr double one_third_root = 0.5774;

// Set columns of T, from `column`, to the unit vectors across the direction in the rows of n from `row`.
inline void set_tangents(const VecX& n, int row, int dim, MatX& T, int column) {
    if (dim == 2) {
        T(row, column) = -n[row + 1];
        T(row + 1, column) = n[row];
        return;
    }
    const Vec3 along(n[row], n[row + 1], n[row + 2]);
    const Vec3 other = std::abs(along[0]) < one_third_root ? Vec3::UnitX() : Vec3::UnitY();
    const Vec3 first = along.cross(other).normalized(), second = along.cross(first);
    for (int k = 0; k < 3; ++k) {
        T(row + k, column) = first[k];
        T(row + k, column + 1) = second[k];
    }
}

}  // namespace pn
