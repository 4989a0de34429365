#include "complementarity/fixed_point/interval_solver.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace pn {

namespace {

// Search in z with y = scale z / s and max(z of the bisected unknowns, s) = 1.
class Search {
public:
    explicit Search(const ReactionEquation& given);
    ReactionRoots run();

private:
    static constexpr IntervalSolverParameters parameters{};

    struct Part {
        int fixed;  // coordinate that is one, while the others run from zero to one
        std::array<double, parameters.max_bisected + 1> center, half;  // per bisected unknown, then of s
    };

    void divide();
    double terms(const VecX& z, double s) const { return 1.0 + (s * in_s_ + L_ * z.cwiseAbs()).maxCoeff(); }
    bool follow(VecX& z, double s) const;
    double reach(const Part& part, VecX& r) const;
    void interval_slope(const VecX& z, double s, const VecX& r, double r_s, int column, MatX& A, MatX& D) const;
    bool is_settled(const Part& part);
    bool polish(int column, VecX& z, double& s) const;
    void keep(const VecX& z, double s);
    void split(const Part& part);
    void newton_from(VecX z);

    int halved() const { return static_cast<int>(halved_.size()); }
    // Return the bisected unknown that is fixed at one in a part, or -1 if s is fixed.
    int column(const Part& part) const { return part.fixed == halved() ? -1 : halved_[part.fixed]; }

    ReactionEquation eq_;
    int n_;
    VecX scale_, in_s_;
    MatX L_, spread_;  // spread: (1 - L)^-1 of the unknowns that are not bisected
    std::vector<int> halved_, following_;
    std::vector<Part> parts_;
    ReactionRoots found_;
};

MatX among(const MatX& L, const std::vector<int>& rows, const std::vector<int>& columns) {
    MatX part(rows.size(), columns.size());
    for (size_t i = 0; i < rows.size(); ++i)
        for (size_t j = 0; j < columns.size(); ++j) part(i, j) = L(rows[i], columns[j]);
    return part;
}

Search::Search(const ReactionEquation& given) : eq_(given), n_(given.size()) {
    // Scale the unknowns to the size that loads without friction give them, directly or through each other.
    std::fill(eq_.directed.begin(), eq_.directed.end(), char(0));
    eq_.steepest(L_);
    const VecX direct_size = eq_.steepest_in_s();
    scale_ = direct_size + L_ * direct_size;
    scale_ = scale_.cwiseMax(scale_.maxCoeff() * 1e-12 + 1e-300);
    for (int k = 0; k < eq_.vectors(); ++k) {
        eq_.offset.col(k) /= scale_[eq_.element[k]];
        eq_.columns.middleRows<3>(3 * k) /= scale_[eq_.element[k]];
    }
    eq_.constant = eq_.constant.cwiseQuotient(scale_);
    eq_.columns = eq_.columns * scale_.asDiagonal();
    eq_.steepest(L_);
    in_s_ = eq_.steepest_in_s();
    divide();
}

// Choose few unknowns to bisect, so that the others contract. Each choice minimizes the spectral bound of the remaining
// unknowns.
void Search::divide() {
    for (int i = 0; i < n_; ++i) following_.push_back(i);
    while (!following_.empty() && spectral_bound(among(L_, following_, following_)) > parameters.max_followed_growth) {
        size_t best = 0;
        double min_bound = HUGE_VAL;
        for (size_t i = 0; i < following_.size(); ++i) {
            std::vector<int> rest = following_;
            rest.erase(rest.begin() + i);
            const double left = rest.empty() ? 0.0 : spectral_bound(among(L_, rest, rest));
            if (left < min_bound) { min_bound = left; best = i; }
        }
        halved_.push_back(following_[best]);
        following_.erase(following_.begin() + best);
    }
    const int m = static_cast<int>(following_.size());
    spread_ = pn::inverse(MatX::Identity(m, m) - among(L_, following_, following_));
}

// Compute the unknowns that are not bisected from the bisected unknowns in z, starting at z. Return false without
// convergence.
bool Search::follow(VecX& z, double s) const {
    const int m = static_cast<int>(following_.size());
    if (m == 0) return true;
    VecX g(n_), residual(m);
    MatX J;
    double before = HUGE_VAL;
    VecX trial = z;
    for (int pass = 0; pass < parameters.max_follow_passes; ++pass) {
        eq_.image(trial, s, g);
        for (int i = 0; i < m; ++i) residual[i] = g[following_[i]] - trial[following_[i]];
        const double error = residual.cwiseAbs().maxCoeff();
        if (error > before * parameters.max_followed_growth) {  // Newton's step failed, but the image itself contracts
            eq_.image(z, s, g);
            for (int i : following_) z[i] = g[i];
            trial = z;
            before = HUGE_VAL;
            continue;
        }
        z = trial;
        if (error <= parameters.residual_tolerance * terms(z, s)) return true;
        before = error;
        eq_.slope(z, s, J);
        const VecX step = solve(MatX::Identity(m, m) - among(J, following_, following_), residual);
        for (int i = 0; i < m; ++i) trial[following_[i]] += step[i];
    }
    return false;
}

// Compute bounds r on the deviation of the unknowns from their values in the middle of a part. Return the bound of s.
double Search::reach(const Part& part, VecX& r) const {
    const double r_s = part.half[halved()];
    r.setZero(n_);
    for (int i = 0; i < halved(); ++i) r[halved_[i]] = part.half[i];
    if (following_.empty()) return r_s;
    VecX driven(following_.size());
    for (size_t i = 0; i < following_.size(); ++i)
        driven[i] = L_.row(following_[i]).dot(r) + in_s_[following_[i]] * r_s;
    const VecX follows = spread_ * driven;
    for (size_t i = 0; i < following_.size(); ++i) r[following_[i]] = follows[i];
    return r_s;
}

// Compute A and D such that the slope of g(z, s) - z in a part is within D of A. s replaces the unknown `column`,
// unless it is -1.
void Search::interval_slope(const VecX& z, double s, const VecX& r, double r_s, int column, MatX& A, MatX& D) const {
    A = -MatX::Identity(n_, n_);
    D.setZero(n_, n_);
    VecX in_s = eq_.constant, spread_in_s = VecX::Zero(n_);
    for (int k = 0; k < eq_.vectors(); ++k) {
        const Eigen::Vector3d load = eq_.vector(k, z, s);
        const Eigen::RowVectorXd lengths = eq_.columns.middleRows<3>(3 * k).colwise().norm();
        const double length = load.norm(), way = lengths.dot(r) + eq_.offset.col(k).norm() * r_s;
        // The direction of the load stays within a cone about its middle value, or is arbitrary.
        const bool directed = way < length;
        const Eigen::Vector3d u = directed ? Eigen::Vector3d(load / length) : Eigen::Vector3d::Zero();
        const double turn = directed ? 2.0 * std::sin(0.5 * std::asin(way / length)) : 1.0;
        const int i = eq_.element[k];
        A.row(i) += u.transpose() * eq_.columns.middleRows<3>(3 * k);
        D.row(i) += turn * lengths;
        in_s[i] += u.dot(eq_.offset.col(k));
        spread_in_s[i] += turn * eq_.offset.col(k).norm();
    }
    if (column < 0) return;
    A.col(column) = in_s;
    D.col(column) = spread_in_s;
}

// Run Newton's method with one coordinate fixed.
bool Search::polish(int column, VecX& z, double& s) const {
    VecX g(n_);
    MatX A, D;
    const VecX none = VecX::Zero(n_);
    for (int pass = 0; pass < ReactionNewton::parameters.max_steps; ++pass) {
        eq_.image(z, s, g);
        const VecX residual = g - z;
        if (residual.cwiseAbs().maxCoeff() <= parameters.residual_tolerance * terms(z, s)) return true;
        interval_slope(z, s, none, 0.0, column, A, D);
        VecX step = solve(A, residual);
        if (!step.allFinite()) return false;
        if (column >= 0) {
            s -= step[column];
            step[column] = 0.0;
        }
        z -= step;
    }
    return false;
}

void Search::keep(const VecX& z, double s) {
    if (s < parameters.infinite_solution_scale) {
        found_.at_edge = true;
        return;
    }
    const VecX y = z / s;
    for (const VecX& other : found_.y) {
        const VecX apart = other.cwiseQuotient(scale_) - y;
        if (apart.cwiseAbs().maxCoeff() <= parameters.same_root * y.cwiseAbs().maxCoeff()) return;
    }
    MatX J;
    eq_.slope(z, s, J);
    if (std::abs(determinant(MatX::Identity(n_, n_) - J)) < parameters.min_determinant) found_.at_edge = true;
    found_.y.push_back(y.cwiseProduct(scale_));
}

void Search::split(const Part& part) {
    size_t widest = 0;
    for (int i = 0; i <= halved(); ++i)
        if (part.half[i] > part.half[widest]) widest = i;
    for (double side : {-0.5, 0.5}) {
        Part one = part;
        one.center[widest] += side * part.half[widest];
        one.half[widest] *= 0.5;
        parts_.push_back(one);
    }
}

// Check if a part of the box holds no solution, or if its only solution is stored (Krawczyk's test).
bool Search::is_settled(const Part& part) {
    VecX z = VecX::Zero(n_), g(n_), r;
    for (int i = 0; i < halved(); ++i) z[halved_[i]] = part.center[i];
    double s = part.center[halved()];
    if (!follow(z, s)) return false;
    eq_.image(z, s, g);
    const double r_s = reach(part, r);
    MatX A, D;
    interval_slope(z, s, r, r_s, column(part), A, D);
    if (column(part) >= 0) r[column(part)] = r_s;
    r.array() = r.array() * (1.0 + parameters.margin) + parameters.residual_tolerance * terms(z, s);
    const VecX residual = g - z;
    if (((residual.cwiseAbs() - (A.cwiseAbs() + D) * r).array() > 0.0).any()) return true;
    const MatX inverse = pn::inverse(A);
    if (!inverse.allFinite()) return false;
    const VecX step = (inverse * residual).cwiseAbs(), bound = inverse.cwiseAbs() * (D * r);
    if (((step - bound - r).array() > 0.0).any()) return true;
    if ((bound.array() > parameters.alone * r.array()).any()) return false;
    if (!polish(column(part), z, s)) return false;
    for (int i = 0; i <= halved(); ++i) {
        const double at = i < halved() ? z[halved_[i]] : s;
        if (std::abs(at - part.center[i]) >
            part.half[i] * (1.0 + parameters.margin) + parameters.margin * parameters.min_box_part)
            return false;
    }
    keep(z, s);
    return true;
}

ReactionRoots Search::run() {
    if (halved() > parameters.max_bisected) {
        found_.complete = false;
    } else {
        for (int fixed = 0; fixed <= halved(); ++fixed) {
            Part face{fixed, {}, {}};
            face.center.fill(0.5);
            face.half.fill(0.5);
            face.center[fixed] = 1.0;
            face.half[fixed] = 0.0;
            parts_.push_back(face);
        }
    }
    const double work = 1.0 + n_ * n_ * n_ / 64.0;
    for (int count = 0; !parts_.empty(); ++count) {
        if (count * work > parameters.max_work) {
            found_.complete = false;
            break;
        }
        const Part part = parts_.back();
        parts_.pop_back();
        if (is_settled(part)) continue;
        if (*std::max_element(part.half.begin(), part.half.begin() + halved() + 1) > parameters.min_box_part) split(part);
        else found_.at_edge = true;
    }
    if (!found_.complete) {
        newton_from(VecX::Zero(n_));
        newton_from(VecX::Ones(n_));
        for (int i = 0; i < n_; ++i) newton_from(VecX::Ones(n_) + parameters.far_newton_start * VecX::Unit(n_, i));
    }
    return std::move(found_);
}

void Search::newton_from(VecX z) {
    double s = 1.0;
    if (polish(-1, z, s) && (z.array() >= -parameters.residual_tolerance).all()) keep(z, s);
}

}  // namespace

ReactionRoots all_roots(const ReactionEquation& equation) { return Search(equation).run(); }

}  // namespace pn
