#include "complementarity/cone/certificate.hpp"

#include <algorithm>
#include <cmath>

#include "math/decompositions.hpp"

namespace pn {

namespace {

// Return the violation of the dual of a contact's cone by its rows u.
double outside_dual(const ConeElement& e, const Eigen::Ref<const VecX>& u) {
    return std::max(0.0, e.bound * u.tail(e.dim - 1).norm() - u[0]);
}

// Find y that shows that no forces prevent penetration. The method projects zero on { w_n + p >= 0 of some forces }.
// Farkas' alternative is the optimality condition of this projection.
bool no_forces(const ConeProblem& p, VecX& y) {
    std::vector<int> rows;
    std::vector<ConeElement> elements = p.elements;
    for (int e = 0; e < p.size(); ++e) {
        const bool equality = p.elements[e].is(ConeKind::equality);
        if (p.elements[e].is(ConeKind::box)) continue;
        for (int k = 0; k < (equality ? p.elements[e].dim : 1); ++k) {
            rows.push_back(p.at[e] + k);
            elements.push_back(equality ? ConeElement{ConeKind::equality, 1, 0.0} : ConeElement::contact(1, 0.0));
        }
    }
    const int n = p.n, m = static_cast<int>(rows.size());
    MatX M = MatX::Identity(n + m, n + m);
    VecX r = VecX::Zero(n + m), f = r;
    M.topLeftCorner(n, n).setZero();
    for (int k = 0; k < m; ++k) {
        M.row(n + k).head(n) = p.W().row(rows[k]);
        M.col(n + k).head(n) = -p.W().row(rows[k]).transpose();
        r[n + k] = p.w0()[rows[k]];
    }
    ConeProblem nearest;
    nearest.associated = true;
    nearest.pose(M, r, elements);
    ConeInteriorPoint().follow(nearest, f, ConeInteriorPoint::Slip::stands);
    f = f.cwiseProduct(nearest.scale());
    y = VecX::Zero(n);
    for (int k = 0; k < m; ++k) y[rows[k]] = f[n + k];
    if (!(y.norm() > 0.0 && y.norm() < HUGE_VAL)) return false;
    y.normalize();
    const VecX u = -(p.W().transpose() * y);
    double margin = -y.dot(p.w0());
    for (int e = 0; e < p.size(); ++e) {
        const ConeElement& element = p.elements[e];
        const auto ue = u.segment(p.at[e], element.dim);
        if (element.is(ConeKind::contact) &&
            (outside_dual(element, ue) > certificate_parameters.zero_tolerance || y[p.at[e]] < 0.0))
            return false;
        if (element.is(ConeKind::equality) && ue.cwiseAbs().maxCoeff() > certificate_parameters.zero_tolerance) return false;
        if (element.is(ConeKind::box)) margin -= element.bound * ue.norm();
    }
    return margin > certificate_parameters.min_margin;
}

// Replace y by a nearby y that balances exactly. Small forces become zero, and forces near the edge of a cone move onto it.
void sharpen(const ConeProblem& p, const MatX& E, double near_edge, VecX& y) {
    const double none = near_edge * y.cwiseAbs().maxCoeff();
    const int rank = static_cast<int>(E.cols());
    MatX J = MatX::Zero(rank + 3 * p.size(), p.n);
    VecX miss = VecX::Zero(J.rows());
    J.topRows(rank) = E.transpose();
    for (int it = 0; it < certificate_parameters.max_sharpenings; ++it) {
        miss.head(rank) = E.transpose() * y;
        for (int e = 0; e < p.size(); ++e) {
            const ConeElement& element = p.elements[e];
            const int i = p.at[e], d = element.dim, row = rank + 3 * e;
            J.middleRows(row, 3).setZero();
            const double length = element.slides() ? y.segment(i + 1, d - 1).norm() : 0.0;
            const bool empty = !element.is(ConeKind::contact) || y[i] <= none;
            if (empty) J.block(row, i, d, d).setIdentity();
            else if (element.bound == 0.0) J.block(row, i + 1, d - 1, d - 1).setIdentity();
            else if (element.slides() && length >= element.bound * y[i] - none) {
                J(row, i) = -element.bound;
                if (length > 0.0) J.block(row, i + 1, 1, d - 1) = y.segment(i + 1, d - 1).transpose() / length;
            }
            miss.segment(row, 3) = J.middleRows(row, 3) * y;
        }
        y -= least_squares(J, miss, certificate_parameters.rank_threshold);
    }
}

// Check if y, scaled to unit length, is in the cones, balances by itself, and has negative work on w0.
bool squeezes(const ConeProblem& p, VecX& y) {
    if (!(y.norm() > 0.0 && y.norm() < HUGE_VAL)) return false;
    y.normalize();
    if ((p.W().transpose() * y).cwiseAbs().maxCoeff() > certificate_parameters.zero_tolerance ||
        -y.dot(p.w0()) < certificate_parameters.min_margin)
        return false;
    for (int e = 0; e < p.size(); ++e) {
        const int i = p.at[e], tails = p.elements[e].dim - 1;
        if (!p.elements[e].is(ConeKind::contact)) continue;
        if (y[i] < -certificate_parameters.zero_tolerance ||
            y.segment(i + 1, tails).norm() > p.elements[e].bound * y[i] + certificate_parameters.zero_tolerance)
            return false;
    }
    return true;
}

// Find the nearest point to -w0 of the forces in the cones that balance by themselves.
bool squeezed(const ConeProblem& p, VecX& y) {
    DenseSolver factors;
    factors.factor_orthogonally(p.W().transpose());
    const int n = p.n, rank = factors.rank();
    MatX E(n, rank);
    factors.range(E);
    MatX M = MatX::Identity(rank + n, rank + n);
    M.topLeftCorner(rank, rank).setZero();
    M.topRightCorner(rank, n) = -E.transpose();
    M.bottomLeftCorner(n, rank) = E;
    VecX r = VecX::Zero(rank + n), f = r;
    r.tail(n) = p.w0();
    std::vector<ConeElement> elements(rank, ConeElement{ConeKind::equality, 1, 0.0});
    for (ConeElement e : p.elements) {
        if (e.is(ConeKind::box)) e.bound = 0.0;
        elements.push_back(e);
    }
    ConeProblem nearest;
    nearest.associated = true;
    nearest.pose(M, r, elements);
    ConeInteriorPoint().follow(nearest, f, ConeInteriorPoint::Slip::stands);
    f = f.cwiseProduct(nearest.scale()).eval();
    for (const double edge : certificate_parameters.zero_force_parts) {
        y = f.tail(n);
        if (!(y.norm() > 0.0 && y.norm() < HUGE_VAL)) return false;
        sharpen(p, E, edge, y);
        if (squeezes(p, y)) return true;
    }
    return false;
}

}  // namespace

ConeStatus find_certificate(const ConeProblem& p, VecX& y) {
    if (no_forces(p, y)) return ConeStatus::infeasible;
    if (squeezed(p, y)) return ConeStatus::jammed;
    y = VecX::Zero(0);
    return ConeStatus::failed;
}

}  // namespace pn
