#include "complementarity/cone/uniqueness.hpp"

#include "math/decompositions.hpp"

namespace pn {

bool has_one_motion(const MatX& W, const std::vector<ConeElement>& elements) {
    const ConeUniquenessParameters& parameters = cone_uniqueness_parameters;
    const Eigen::Index n = W.rows();
    if (n == 0) return true;
    if (n > parameters.max_rows) return false;
    const Spectrum spectrum = symmetric_spectrum(W);
    const VecX& values = spectrum.values;  // ascending
    const Eigen::Index rank = (values.array() > parameters.min_response * values[n - 1]).count();
    const MatX V = spectrum.vectors.rightCols(rank);
    const VecX root = values.tail(rank).cwiseSqrt();
    MatX S = MatX::Zero(rank, rank);
    Eigen::Index at = 0;
    for (const ConeElement& e : elements) {
        if (e.slides() && e.bound > 0.0) {
            const VecX along = V.row(at).transpose();
            if (1.0 - along.squaredNorm() > parameters.max_share) return false;  // shares its load
            const MatX A = V.middleRows(at + 1, e.dim - 1) * root.asDiagonal();
            const VecX b = along.cwiseQuotient(root);
            const double ratio = b.norm() / A.norm();
            S += 0.5 * e.bound * (ratio * A.transpose() * A + b * b.transpose() / ratio);
        }
        at += e.dim;
    }
    return symmetric_spectrum(S).values.maxCoeff() < 1.0 - parameters.rounding;
}

}  // namespace pn
