#include "math/anderson.hpp"

#include <algorithm>

#include "math/decompositions.hpp"

namespace pn {

VecX AndersonAcceleration::next(const VecX& x, const VecX& g) {
    const VecX residual = g - x;
    if (count_ == 0) {
        value_changes_.resize(x.size(), parameters.memory);
        residual_changes_.resize(x.size(), parameters.memory);
    } else {
        const int column = (count_ - 1) % parameters.memory;
        value_changes_.col(column) = g - last_value_;
        residual_changes_.col(column) = residual - last_residual_;
    }
    const bool expands = count_ > 0 && (residual - last_residual_).dot(x - (last_value_ - last_residual_)) > 0.0;
    if (expands) restart();
    const int known = std::min(count_++, parameters.memory);
    last_value_ = g;
    last_residual_ = residual;
    if (known == 0) return g;
    const VecX part = least_squares(residual_changes_.leftCols(known), residual, parameters.dependent_change);
    return g - value_changes_.leftCols(known) * part;
}

}  // namespace pn
