#include "complementarity/cone/residuals.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace pn {

namespace {

constexpr ConeEnergyParameters energy_parameters{};

}  // namespace

bool add_energy(double conveyed, double free, double uncoupled) {
    return !(conveyed <= energy_parameters.factor * std::max(free, 0.0) + energy_parameters.rounding * uncoupled);
}

bool add_energy(const Eigen::Ref<const MatX>& W, const Eigen::Ref<const VecX>& w0, const Eigen::Ref<const VecX>& f) {
    return add_energy(f.dot(W * f), -f.dot(w0), W.diagonal().dot(f.cwiseAbs2()));
}

void add_residuals(const ConeElement& e, const double* f, const double* w, double force, double speed,
                   ConeResiduals& out) {
    constexpr double min_size = std::numeric_limits<double>::min();
    force = std::max(force, min_size);
    speed = std::max(speed, min_size);
    const int head = e.is(ConeKind::contact);
    double limit = e.bound, ft = 0.0, wt = 0.0, product = 0.0;
    if (head) {
        limit *= std::max(f[0], 0.0);
        out.signorini = std::max({out.signorini, -w[0] / speed, -f[0] / force, std::abs(f[0] * w[0]) / (force * speed)});
    }
    for (int k = head; k < e.dim; ++k) {
        ft += f[k] * f[k];
        wt += w[k] * w[k];
        product += f[k] * w[k];
    }
    ft = std::sqrt(ft);
    wt = std::sqrt(wt);
    if (e.is(ConeKind::equality)) {
        out.signorini = std::max(out.signorini, wt / speed);
    } else {
        out.coulomb = std::max(out.coulomb, (ft - limit) / force);
        out.dissipation = std::max(out.dissipation, std::abs(product + limit * wt) / (force * speed));
    }
}

ConeResiduals cone_residuals(const Eigen::Ref<const MatX>& W, const Eigen::Ref<const VecX>& w0,
                             const std::vector<ConeElement>& elements, const Eigen::Ref<const VecX>& f) {
    ConeResiduals out;
    if (w0.size() == 0) return out;
    const double force = f.cwiseAbs().maxCoeff(), free = w0.cwiseAbs().maxCoeff();
    int i = 0;
    for (const ConeElement& e : elements) {
        double w[3] = {0.0, 0.0, 0.0}, speed = free;
        for (int k = 0; k < e.dim; ++k) {
            w[k] = w0[i + k] + W.row(i + k).dot(f);
            speed = std::max(speed, W.row(i + k).cwiseAbs().dot(f.cwiseAbs()));
        }
        add_residuals(e, f.data() + i, w, force, speed, out);
        i += e.dim;
    }
    return out;
}

}  // namespace pn
