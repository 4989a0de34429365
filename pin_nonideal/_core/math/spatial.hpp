// Spatial quantities of rigid bodies, in world axes about a reference point (one per kinematic tree, one per body of a
// deep tree). A motion is (velocity of the body point at the reference, angular velocity). A force is (force, moment
// about it).
//
// Vectors of three components occupy four lanes, the last of them zero: one register in wide functions.
#pragma once

#include <cmath>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "math/lanes.hpp"

namespace pn {

using VecX = Eigen::VectorXd;
using MatX = Eigen::MatrixXd;

struct Vec3 {
    alignas(32) Lanes x = {};  // alignment of the wide registers, even without AVX2 at compile time

    PN_INLINE Vec3() {}
    PN_INLINE explicit Vec3(const Lanes& lanes) : x(lanes) {}
    PN_INLINE Vec3(double a, double b, double c) : x{a, b, c, 0.0} {}
    template <class Derived>
    Vec3(const Eigen::MatrixBase<Derived>& v) : x{v[0], v[1], v[2], 0.0} {}
    // Copies are written by hand, so that both versions of a wide function pass the vector in memory. They throw nothing:
    // a growing std::vector then moves the elements that contain vectors.
    PN_INLINE Vec3(const Vec3& o) noexcept : x(o.x) {}
    PN_INLINE Vec3& operator=(const Vec3& o) noexcept { x = o.x; return *this; }

    static PN_INLINE Vec3 Zero() { return {}; }
    static PN_INLINE Vec3 UnitX() { return {1.0, 0.0, 0.0}; }
    static PN_INLINE Vec3 UnitY() { return {0.0, 1.0, 0.0}; }
    static PN_INLINE Vec3 UnitZ() { return {0.0, 0.0, 1.0}; }
    Eigen::Vector3d eigen() const { return {x[0], x[1], x[2]}; }

    PN_INLINE double operator[](int k) const { return x[k]; }
    PN_INLINE double& operator[](int k) { return reinterpret_cast<double*>(&x)[k]; }
    PN_INLINE Vec3& operator+=(const Vec3& o) { x += o.x; return *this; }
    PN_INLINE Vec3& operator-=(const Vec3& o) { x -= o.x; return *this; }

    inline double dot(const Vec3& o) const;
    inline Vec3 cross(const Vec3& o) const;
    inline double squaredNorm() const;
    inline double norm() const;
    Vec3 normalized() const;
};

PN_INLINE Vec3 operator+(const Vec3& a, const Vec3& b) { return Vec3(a.x + b.x); }
PN_INLINE Vec3 operator-(const Vec3& a, const Vec3& b) { return Vec3(a.x - b.x); }
PN_INLINE Vec3 operator-(const Vec3& a) { return Vec3(-a.x); }
PN_INLINE Vec3 operator*(double s, const Vec3& a) { return Vec3(s * a.x); }
PN_INLINE Vec3 operator*(const Vec3& a, double s) { return Vec3(a.x * s); }
PN_INLINE Vec3 operator/(const Vec3& a, double s) { return Vec3(a.x / s); }

// Return the components in the order y, z, x.
PN_INLINE Vec3 cyclic_shift(const Vec3& a) {
#if defined(__clang__)
    return Vec3(__builtin_shufflevector(a.x, a.x, 1, 2, 0, 3));
#else
    // Shuffle by halves: registers of two numbers can do this, and GCC merges it into one permutation of four.
    using Indices = long long __attribute__((vector_size(16)));
    const TwoLanes low = {a.x[0], a.x[1]}, high = {a.x[2], a.x[3]};
    const TwoLanes yz = __builtin_shuffle(low, high, Indices{1, 2}), x0 = __builtin_shuffle(low, high, Indices{0, 3});
    return Vec3(Lanes{yz[0], yz[1], x0[0], x0[1]});
#endif
}

PN_INLINE double Vec3::dot(const Vec3& o) const { return sum(x * o.x); }
PN_INLINE Vec3 Vec3::cross(const Vec3& o) const {
    return cyclic_shift(Vec3(x * cyclic_shift(o).x - cyclic_shift(*this).x * o.x));
}
PN_INLINE double Vec3::squaredNorm() const { return dot(*this); }
PN_INLINE double Vec3::norm() const { return std::sqrt(squaredNorm()); }
inline Vec3 Vec3::normalized() const { return *this / norm(); }

struct Mat3 {
    Vec3 c[3];  // columns

    PN_INLINE Mat3() {}
    PN_INLINE Mat3(const Vec3& a, const Vec3& b, const Vec3& d) : c{a, b, d} {}
    template <class Derived>
    Mat3(const Eigen::MatrixBase<Derived>& m) : c{m.col(0), m.col(1), m.col(2)} {}
    // Copies written by hand as for Vec3: inlined everywhere.
    PN_INLINE Mat3(const Mat3& o) noexcept : c{o.c[0], o.c[1], o.c[2]} {}
    PN_INLINE Mat3& operator=(const Mat3& o) noexcept {
        for (int k = 0; k < 3; ++k) c[k] = o.c[k];
        return *this;
    }

    static Mat3 Identity() { return {Vec3::UnitX(), Vec3::UnitY(), Vec3::UnitZ()}; }
    Eigen::Matrix3d eigen() const {
        Eigen::Matrix3d m;
        for (int k = 0; k < 3; ++k)
            for (int i = 0; i < 3; ++i) m(i, k) = c[k][i];
        return m;
    }

    PN_INLINE const Vec3& col(int k) const { return c[k]; }
    PN_INLINE Vec3& col(int k) { return c[k]; }
    PN_INLINE double operator()(int row, int column) const { return c[column][row]; }
    PN_INLINE Mat3& operator+=(const Mat3& o) {
        for (int k = 0; k < 3; ++k) c[k] += o.c[k];
        return *this;
    }
};

PN_INLINE Vec3 operator*(const Mat3& m, const Vec3& v) { return v[0] * m.c[0] + v[1] * m.c[1] + v[2] * m.c[2]; }
PN_INLINE Mat3 operator*(const Mat3& a, const Mat3& b) { return {a * b.c[0], a * b.c[1], a * b.c[2]}; }
PN_INLINE Vec3 transpose_times(const Mat3& m, const Vec3& v) { return {m.c[0].dot(v), m.c[1].dot(v), m.c[2].dot(v)}; }
// a^T b
PN_INLINE Mat3 transpose_times(const Mat3& a, const Mat3& b) {
    return {transpose_times(a, b.c[0]), transpose_times(a, b.c[1]), transpose_times(a, b.c[2])};
}
PN_INLINE Mat3 transposed(const Mat3& m) {
    return {Vec3(m.c[0][0], m.c[1][0], m.c[2][0]), Vec3(m.c[0][1], m.c[1][1], m.c[2][1]),
            Vec3(m.c[0][2], m.c[1][2], m.c[2][2])};
}
// a b^T
PN_INLINE Mat3 times_transpose(const Mat3& a, const Mat3& b) {
    Mat3 out;
    for (int k = 0; k < 3; ++k) out.c[k] = b(k, 0) * a.c[0] + b(k, 1) * a.c[1] + b(k, 2) * a.c[2];
    return out;
}

struct Motion {
    Vec3 lin, ang;
    PN_INLINE Motion& operator+=(const Motion& o) { lin += o.lin; ang += o.ang; return *this; }
};

struct Force {
    Vec3 lin, ang;
    PN_INLINE Force& operator+=(const Force& o) { lin += o.lin; ang += o.ang; return *this; }
    PN_INLINE Force& operator-=(const Force& o) { lin -= o.lin; ang -= o.ang; return *this; }
};

PN_INLINE Force operator*(double s, const Force& f) { return {s * f.lin, s * f.ang}; }
PN_INLINE Motion operator*(double s, const Motion& m) { return {s * m.lin, s * m.ang}; }
PN_INLINE Motion operator+(const Motion& a, const Motion& b) { return {a.lin + b.lin, a.ang + b.ang}; }

// Power of a force on a motion.
PN_INLINE double dot(const Motion& m, const Force& f) { return sum(m.lin.x * f.lin.x + m.ang.x * f.ang.x); }

// Shift a motion to a reference point at +r, and a force to a reference point at -r.
PN_INLINE Motion further(const Motion& m, const Vec3& r) { return {m.lin + m.ang.cross(r), m.ang}; }
PN_INLINE Force before(const Force& f, const Vec3& r) { return {f.lin, f.ang + r.cross(f.lin)}; }

// Rate of change of a motion b carried by v, and of a force f carried by v.
PN_INLINE Motion cross(const Motion& v, const Motion& b) {
    return {v.ang.cross(b.lin) + v.lin.cross(b.ang), v.ang.cross(b.ang)};
}
PN_INLINE Force cross(const Motion& v, const Force& f) {
    return {v.ang.cross(f.lin), v.ang.cross(f.ang) + v.lin.cross(f.lin)};
}

// Rigid-body inertia about the reference point: mass, first moment, second moment.
struct Inertia {
    double mass = 0.0;
    Vec3 first;
    Mat3 second;

    PN_INLINE Inertia& operator+=(const Inertia& o) {
        mass += o.mass;
        first += o.first;
        second += o.second;
        return *this;
    }
    PN_INLINE Force operator*(const Motion& m) const {
        return {mass * m.lin - first.cross(m.ang), second * m.ang + first.cross(m.lin)};
    }
};

// Articulated inertia of a body and the bodies that hang on it by free joints. The mass in an articulated inertia depends on
// the direction.
struct ArticulatedInertia {
    Mat3 lin, couple, ang;  // force (lin a + couple w, couple^T a + ang w) for the motion (a, w)

    PN_INLINE ArticulatedInertia& operator+=(const ArticulatedInertia& o) {
        lin += o.lin;
        couple += o.couple;
        ang += o.ang;
        return *this;
    }
    PN_INLINE Force operator*(const Motion& m) const {
        return {lin * m.lin + couple * m.ang, transpose_times(couple, m.lin) + ang * m.ang};
    }
};

PN_INLINE ArticulatedInertia articulated(const Inertia& Y) {
    const Vec3 &x = Vec3::UnitX(), &y = Vec3::UnitY(), &z = Vec3::UnitZ();
    return {Mat3(Y.mass * x, Y.mass * y, Y.mass * z), Mat3(x.cross(Y.first), y.cross(Y.first), z.cross(Y.first)),
            Y.second};
}
// Subtract the part u u^T / D that a free dof releases, with the dof's force u = P J and gain = u / D.
PN_INLINE void release(ArticulatedInertia& P, const Force& u, const Force& gain) {
    for (int k = 0; k < 3; ++k) {
        P.lin.c[k] -= gain.lin[k] * u.lin;
        P.couple.c[k] -= gain.ang[k] * u.lin;
        P.ang.c[k] -= gain.ang[k] * u.ang;
    }
}
// Shift an articulated inertia to a reference point at -r.
PN_INLINE ArticulatedInertia before(const ArticulatedInertia& P, const Vec3& r) {
    const Vec3 &a = P.lin.c[0], &b = P.lin.c[1], &c = P.lin.c[2];
    const Mat3 turned(r[2] * b - r[1] * c, r[0] * c - r[2] * a, r[1] * a - r[0] * b);  // lin [r]
    Mat3 half, ang = P.ang;
    ArticulatedInertia out{P.lin, P.couple, ang};
    for (int k = 0; k < 3; ++k) {
        half.c[k] = r.cross(P.couple.c[k] - 0.5 * turned.c[k]);
        out.couple.c[k] -= turned.c[k];
    }
    const Mat3 other = transposed(half);
    for (int k = 0; k < 3; ++k) out.ang.c[k] += half.c[k] + other.c[k];
    return out;
}

}  // namespace pn
