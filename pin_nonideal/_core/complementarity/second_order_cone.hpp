// The second-order cone |tail| <= head: its algebra, the step to its boundary, and Nesterov and Todd's scaling of a
// pair of points (Vandenberghe, "The CVXOPT linear and quadratic cone program solvers", 2010).
#pragma once

#include <algorithm>
#include <cmath>

#include <Eigen/Core>

namespace pn {

// Fraction of the way to the cone's boundary that a step of an interior-point method may take.
constexpr double max_boundary_part = 0.99;

// A vector of the cone's algebra. Elements of fewer directions leave the rest of the tail zero.
struct Cone {
    double head = 0.0;
    Eigen::Vector3d tail = Eigen::Vector3d::Zero();

    double dot(const Cone& o) const { return head * o.head + tail.dot(o.tail); }
    double determinant() const { return (head - tail.norm()) * (head + tail.norm()); }
    Cone mirrored() const { return {head, -tail}; }
    Cone operator+(const Cone& o) const { return {head + o.head, tail + o.tail}; }
    Cone operator-(const Cone& o) const { return {head - o.head, tail - o.tail}; }
    Cone operator*(double k) const { return {k * head, k * tail}; }
};

inline Cone product(const Cone& a, const Cone& b) { return {a.dot(b), a.head * b.tail + b.head * a.tail}; }

// Return x with product(a, x) = b.
inline Cone quotient(const Cone& b, const Cone& a) {
    const double head = (a.head * b.head - a.tail.dot(b.tail)) / a.determinant();
    return {head, (b.tail - head * a.tail) / a.head};
}

// Return the largest step along d that stays in the cone.
inline double room(const Cone& u, const Cone& d) {
    const double a = d.head * d.head - d.tail.squaredNorm();
    const double b = u.head * d.head - u.tail.dot(d.tail), c = u.determinant();
    const double root = std::sqrt(std::max(b * b - a * c, 0.0)), q = -(b + std::copysign(root, b));
    double least = HUGE_VAL;
    if (a != 0.0 && q / a > 0.0) least = q / a;
    if (q != 0.0 && c / q > 0.0) least = std::min(least, c / q);
    return least;
}

// Symmetric map T with T y = T^-1 z.
struct Scaling {
    Cone w, v;     // T^2 = beta (2 w w^T - J), T = sqrt(beta) (2 v v^T - J), J the reflection of the tail
    double root = 1.0;  // sqrt(beta)
    Cone scaled;   // T y

    Scaling() = default;
    Scaling(const Cone& z, const Cone& y) {
        const double dz = z.determinant(), dy = y.determinant();
        const Cone zn = z * (1.0 / std::sqrt(dz)), yn = y * (1.0 / std::sqrt(dy));
        const double gamma = std::sqrt(0.5 * (1.0 + zn.dot(yn)));
        w = (zn + yn.mirrored()) * (0.5 / gamma);
        v = w;
        v.head += 1.0;
        v = v * (1.0 / std::sqrt(2.0 * v.head));
        root = std::sqrt(std::sqrt(dz / dy));
        scaled = forth(y);
    }
    Cone forth(const Cone& u) const { return (v * (2.0 * v.dot(u)) - u.mirrored()) * root; }
    Cone back(const Cone& u) const {
        const Cone m = v.mirrored();
        return (m * (2.0 * m.dot(u)) - u.mirrored()) * (1.0 / root);
    }
};

}  // namespace pn
