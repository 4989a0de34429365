#include "complementarity/least_norm_friction.hpp"

#include <algorithm>
#include <cmath>

#include "math/decompositions.hpp"

namespace pn {

bool LeastNormFriction::solve(const MatX& W, const std::vector<int>& dims, const FrictionLimits& limits, VecX& force) {
    if (force.size() == 0) return true;
    read(W, dims, limits, force);
    value_ = evaluate();
    for (int iteration = 0; !is_done(); ++iteration) {
        if (iteration == parameters.max_iterations) return false;
        find_step();
        if (!move()) return false;
    }
    force = unit_.cwiseProduct(g_);
    return true;
}

void LeastNormFriction::read(const MatX& W, const std::vector<int>& dims, const FrictionLimits& limits,
                             const VecX& force) {
    elements_.clear();
    unit_.resize(force.size());
    middle_ = limits.middle;
    int at = 0;
    for (size_t e = 0; e < dims.size(); at += dims[e++]) {
        const double response = std::sqrt(W.diagonal().segment(at, dims[e]).mean());
        unit_.segment(at, dims[e]).setConstant(response > 0.0 ? 1.0 / response : 0.0);
        middle_.segment(at, dims[e]) *= response;
        elements_.push_back({at, dims[e], limits.size[e] * response, 0.0, 0.0});
    }
    const Spectrum spectrum = symmetric_spectrum(unit_.asDiagonal() * W * unit_.asDiagonal());
    const double smallest = parameters.rank_tolerance * spectrum.values[force.size() - 1];
    range_ = spectrum.vectors.rightCols((spectrum.values.array() > smallest).count());
    motion_ = range_.transpose() * (unit_.array() > 0.0).select(force.array() / unit_.array(), 0.0).matrix();
}

// Compute the force g and the value of the dual function for the multipliers.
double LeastNormFriction::evaluate() {
    weight_.resize(unit_.size());
    for (const Element& e : elements_) weight_.segment(e.row, e.dim).setConstant(1.0 / (1.0 + e.nu));
    offset_ = middle_ - weight_.cwiseProduct(middle_);
    factor_.compute(range_.transpose() * weight_.asDiagonal() * range_);
    const VecX y = factor_.solve(motion_ - range_.transpose() * offset_);
    g_ = weight_.cwiseProduct(range_ * y) + offset_;
    double value = 0.5 * g_.squaredNorm();
    for (Element& e : elements_) {
        e.distance = (g_ - middle_).segment(e.row, e.dim).norm();
        value += e.nu * e.gradient();
    }
    return value;
}

// Check if all forces are within their limits, and at their limits where a multiplier is positive.
bool LeastNormFriction::is_done() const {
    const double rounding = parameters.force_rounding * g_.cwiseAbs().maxCoeff();
    for (const Element& e : elements_) {
        const double error = e.nu > 0.0 ? std::abs(e.excess()) : e.excess();
        if (error > parameters.limit_tolerance * e.limit + rounding) return false;
    }
    return true;
}

// Compute the change of the force with one multiplier.
void LeastNormFriction::respond(const Element& element, VecX& change) const {
    change.setZero(g_.size());
    change.segment(element.row, element.dim) =
        (weight_.cwiseProduct(middle_ - g_)).segment(element.row, element.dim);
    const VecX y = factor_.solve(range_.transpose() * change);
    change -= weight_.cwiseProduct(range_ * y);
}

// Find Newton's step. Multipliers remain zero if the step would make them negative.
void LeastNormFriction::find_step() {
    changed_.clear();
    for (size_t e = 0; e < elements_.size(); ++e)
        if (elements_[e].nu > 0.0 || elements_[e].excess() > 0.0) changed_.push_back(static_cast<int>(e));
    const size_t count = changed_.size();
    MatX hessian(count, count);
    VecX gradient(count);
    for (size_t j = 0; j < count; ++j) {
        respond(elements_[changed_[j]], change_);
        gradient[j] = elements_[changed_[j]].gradient();
        for (size_t i = 0; i < count; ++i) {
            const Element& e = elements_[changed_[i]];
            hessian(i, j) = (middle_ - g_).segment(e.row, e.dim).dot(change_.segment(e.row, e.dim));
        }
    }
    hessian.diagonal() *= 1.0 + parameters.regularization;
    std::vector<int> free(count), kept;
    for (size_t j = 0; j < count; ++j) free[j] = static_cast<int>(j);
    while (true) {
        step_ = solve_semidefinite(hessian(free, free), gradient(free));
        kept.clear();
        for (size_t k = 0; k < free.size(); ++k)
            if (elements_[changed_[free[k]]].nu > 0.0 || step_[k] > 0.0) kept.push_back(free[k]);
        if (kept.size() == free.size()) break;
        free = kept;
    }
    for (int& k : free) k = changed_[k];
    changed_ = free;
}

// Take the longest halved step along which the dual function does not decrease.
bool LeastNormFriction::move() {
    std::vector<double> nu;
    for (const int e : changed_) nu.push_back(elements_[e].nu);
    double length = 1.0;
    for (int halving = 0; halving < parameters.max_halvings; ++halving, length *= 0.5) {
        for (size_t k = 0; k < changed_.size(); ++k)
            elements_[changed_[k]].nu = std::max(0.0, nu[k] + length * step_[k]);
        const double value = evaluate();
        if (value < value_ - parameters.value_rounding * std::abs(value_)) continue;
        value_ = value;
        return true;
    }
    return false;
}

}  // namespace pn
