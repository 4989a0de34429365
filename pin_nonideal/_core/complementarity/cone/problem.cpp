#include "complementarity/cone/problem.hpp"

#include <algorithm>
#include <cmath>

namespace pn {

void ConeProblem::pose(const Eigen::Ref<const MatX>& W, const Eigen::Ref<const VecX>& w0,
                       const std::vector<ConeElement>& list) {
    n = static_cast<int>(w0.size());
    elements.assign(list.begin(), list.end());
    at.clear();
    auto scale = scale_.vector(n);
    const double largest = n > 0 ? W.diagonal().cwiseAbs().maxCoeff() : 0.0;
    int row = 0;
    for (const ConeElement& e : elements) {
        at.push_back(row);
        const double own_response = W.diagonal().segment(row, e.dim).cwiseAbs().maxCoeff();
        const double response = own_response > parameters.min_element_response * largest ? own_response : largest;
        scale.segment(row, e.dim).setConstant(response > 0.0 ? 1.0 / std::sqrt(response) : 1.0);
        row += e.dim;
    }
    this->W() = scale.asDiagonal() * W * scale.asDiagonal();
    this->w0() = scale.cwiseProduct(w0);
    unit_ = n > 0 ? this->w0().cwiseAbs().maxCoeff() : 1.0;
    if (unit_ == 0.0) unit_ = 1.0;
    this->w0() /= unit_;
    for (int e = 0; e < size(); ++e)
        if (elements[e].is(ConeElement::Kind::box)) elements[e].bound /= unit_ * scale[at[e]];
    measure();
}

void ConeProblem::measure() {
    auto stiffness = stiffness_.vector(size());
    for (int e = 0; e < size(); ++e) {
        const double mean_response = W().diagonal().segment(at[e], elements[e].dim).cwiseAbs().mean();
        stiffness[e] = mean_response > parameters.min_element_response ? 1.0 / mean_response : 1.0;
    }
}

void ConeProblem::force_scales(const Eigen::Ref<const VecX>& f, Eigen::Ref<VecX> size_of) const {
    for (int e = 0; e < size(); ++e) {
        double most = 0.0;
        for (int i = at[e]; i < at[e] + elements[e].dim; ++i)
            most = std::max(most, std::abs(f[i]) + stiffness(e) * W().row(i).cwiseAbs().dot(f.cwiseAbs()));
        size_of[e] = stiffness(e) + parameters.squeeze * most;
    }
}

}  // namespace pn
