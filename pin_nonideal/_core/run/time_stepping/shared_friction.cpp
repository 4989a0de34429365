#include "run/time_stepping/shared_friction.hpp"

#include "math/decompositions.hpp"

namespace pn {

namespace {

// Return forces with a response of one. Each row must respond to its force.
VecX unit_forces(const SharedFriction::Responses& W, const std::vector<int>& rows) {
    return W.diagonal()(rows).cwiseSqrt().cwiseInverse();
}

}  // namespace

bool SharedFriction::are_dependent(const Responses& W, const std::vector<int>& rows) {
    if (rows.empty()) return false;
    if (!W.diagonal()(rows).all()) return true;
    const VecX unit = unit_forces(W, rows);
    Cholesky factor;
    const bool is_definite = factor.compute(unit.asDiagonal() * W(rows, rows) * unit.asDiagonal());
    const double root = is_definite ? factor.factor().diagonal().minCoeff() : 0.0;
    return root * root < parameters.dependent_pivot;
}

void SharedFriction::share(const Responses& W, const std::vector<Element>& sticking, VecX& force) {
    if (sticking.empty()) return;
    rows_.clear();
    dims_.clear();
    for (const Element& element : sticking) {
        dims_.push_back(element.dim);
        for (int k = 0; k < element.dim; ++k) rows_.push_back(element.row + k);
    }
    limits_ = FrictionLimits(static_cast<int>(sticking.size()), static_cast<int>(rows_.size()));
    int at = 0;
    for (size_t e = 0; e < sticking.size(); at += dims_[e], ++e) {
        limits_.size[e] = sticking[e].limit;
        limits_.middle[at] = sticking[e].middle;
    }
    force_ = force(rows_);
    least_norm_.solve(W(rows_, rows_), dims_, limits_, force_);
    force(rows_) = force_;
}

void SharedFriction::drop_prevented_slip(const Responses& W, const std::vector<int>& rows, VecX& slips) {
    if (rows.empty()) return;
    const VecX unit = unit_forces(W, rows);
    const Spectrum spectrum = symmetric_spectrum(unit.asDiagonal() * W(rows, rows) * unit.asDiagonal());
    const double smallest = parameters.dependent_pivot * spectrum.values.maxCoeff();
    const MatX range = spectrum.vectors.rightCols((spectrum.values.array() > smallest).count());
    const VecX slip = unit.cwiseProduct(slips(rows));
    slips(rows) = (range * (range.transpose() * slip)).cwiseQuotient(unit);
}

}  // namespace pn
