// The formulas of constraints between bodies, taken with dual numbers: the derivative of a residual along a motion is
// its rate, and that of a rate is the bias. Prints each row that is not so.
#include <cstdio>
#include <random>

#include "constraints/row_type.hpp"
#include "constraints/row_completeness.hpp"

struct Dual {  // value and derivative in time
    double x = 0.0, d = 0.0;
    Dual() = default;
    Dual(double value, double rate = 0.0) : x(value), d(rate) {}
    Dual& operator*=(const Dual& o) { return *this = {x * o.x, x * o.d + d * o.x}; }
    Dual& operator+=(const Dual& o) { return *this = {x + o.x, d + o.d}; }
};
Dual operator+(const Dual& a, const Dual& b) { return {a.x + b.x, a.d + b.d}; }
Dual operator-(const Dual& a, const Dual& b) { return {a.x - b.x, a.d - b.d}; }
Dual operator-(const Dual& a) { return {-a.x, -a.d}; }
Dual operator*(const Dual& a, const Dual& b) { return {a.x * b.x, a.x * b.d + a.d * b.x}; }
Dual operator/(const Dual& a, const Dual& b) { return {a.x / b.x, (a.d - a.x / b.x * b.d) / b.x}; }
bool operator<(const Dual& a, const Dual& b) { return a.x < b.x; }
bool operator>(const Dual& a, const Dual& b) { return a.x > b.x; }
bool operator>=(const Dual& a, const Dual& b) { return a.x >= b.x; }
bool operator<=(const Dual& a, const Dual& b) { return a.x <= b.x; }
bool operator!=(const Dual& a, const Dual& b) { return a.x != b.x; }
Dual sqrt(const Dual& a) { return {std::sqrt(a.x), 0.5 * a.d / std::sqrt(a.x)}; }
Dual atan2(const Dual& y, const Dual& x) {
    return {std::atan2(y.x, x.x), (y.d * x.x - y.x * x.d) / (x.x * x.x + y.x * y.x)};
}

namespace Eigen {
template <>
struct NumTraits<Dual> : NumTraits<double> {
    using Real = Dual;
    using NonInteger = Dual;
    using Nested = Dual;
};
}  // namespace Eigen

template <class S>
struct Vec {
    S c[3];
    template <class Derived>
    Vec(const Eigen::MatrixBase<Derived>& v) : c{v[0], v[1], v[2]} {}
    Vec() : c{S(0.0), S(0.0), S(0.0)} {}
    Vec(const S& x, const S& y, const S& z) : c{x, y, z} {}
    Vec(const pn::Vec3& v) : c{S(v[0]), S(v[1]), S(v[2])} {}
    const S& operator[](int k) const { return c[k]; }
    S dot(const Vec& o) const { return c[0] * o[0] + c[1] * o[1] + c[2] * o[2]; }
    Vec cross(const Vec& o) const {
        return {c[1] * o[2] - c[2] * o[1], c[2] * o[0] - c[0] * o[2], c[0] * o[1] - c[1] * o[0]};
    }
    S squaredNorm() const { return dot(*this); }
    S norm() const { using std::sqrt; return sqrt(dot(*this)); }
};
template <class S> Vec<S> operator+(const Vec<S>& a, const Vec<S>& b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }
template <class S> Vec<S> operator-(const Vec<S>& a, const Vec<S>& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
template <class S> Vec<S> operator-(const Vec<S>& a) { return {-a[0], -a[1], -a[2]}; }
template <class S, class T> Vec<S> operator*(const T& s, const Vec<S>& a) { return {s * a[0], s * a[1], s * a[2]}; }
template <class S> Vec<S> operator*(const Vec<S>& a, const S& s) { return {s * a[0], s * a[1], s * a[2]}; }
template <class S> Vec<S> operator/(const Vec<S>& a, const S& s) { return {a[0] / s, a[1] / s, a[2] / s}; }

template <class S>
struct Mat {
    Vec<S> c[3];
    const Vec<S>& col(int k) const { return c[k]; }
    Eigen::Matrix<S, 3, 3> eigen() const {
        Eigen::Matrix<S, 3, 3> m;
        for (int i = 0; i < 9; ++i) m(i % 3, i / 3) = c[i / 3][i % 3];
        return m;
    }
};
template <class S> Vec<S> operator*(const Mat<S>& m, const Vec<S>& v) {
    return v[0] * m.c[0] + v[1] * m.c[1] + v[2] * m.c[2];
}
template <class S> Vec<S> operator*(const Mat<S>& m, const pn::Vec3& v) { return m * Vec<S>(v); }

template <class S> Mat<S> transpose_times(const Mat<S>& a, const Mat<S>& b) {
    Mat<S> out;
    for (int k = 0; k < 3; ++k) out.c[k] = {a.c[0].dot(b.c[k]), a.c[1].dot(b.c[k]), a.c[2].dot(b.c[k])};
    return out;
}

// A frame with its place, velocity and acceleration; taken with dual numbers, each with its rate.
struct Motion {
    Mat<double> R;
    Vec<double> x, v, a, omega, alpha;
};
template <class S>
struct TestPose {
    using Scalar = S;
    using Vec = ::Vec<S>;
    Mat<S> R;
    Vec x, v, a, turn, turn_rate;
    const Vec& omega() const { return turn; }
    const Vec& alpha() const { return turn_rate; }
    Vec velocity(const Vec& at) const { return v + turn.cross(at - x); }
    Vec acceleration(const Vec& at) const {
        return a + turn_rate.cross(at - x) + turn.cross(turn.cross(at - x));
    }
};
Vec<Dual> with_rate(const Vec<double>& x, const Vec<double>& d) { return {{x[0], d[0]}, {x[1], d[1]}, {x[2], d[2]}}; }
void place(const Motion& m, TestPose<double>& p) { p = {m.R, m.x, m.v, m.a, m.omega, m.alpha}; }
void place(const Motion& m, TestPose<Dual>& p) {
    for (int k = 0; k < 3; ++k) p.R.c[k] = with_rate(m.R.c[k], m.omega.cross(m.R.c[k]));
    p.x = with_rate(m.x, m.v);
    p.v = with_rate(m.v, m.a);
    p.turn = with_rate(m.omega, m.alpha);
}

template <class S>
struct Rows {
    S residual[6], rate[6], bias[6], phi_t[6], phi_tt[6];
    pn::WrenchOf<Vec<S>> wrench[6];
};

std::mt19937 generator(1);
Vec<double> any() {
    std::normal_distribution<double> normal;
    return {normal(generator), normal(generator), normal(generator)};
}
Motion any_motion() {
    const Vec<double> z = any(), e = z / z.norm(), y = any().cross(e), f = y / y.norm();
    return {{{f, e.cross(f), e}}, any(), any(), any(), any(), any()};
}

int wrong = 0;
void compare(const char* what, int row, double x, double y) {
    if (std::abs(x - y) <= 1e-11 * (1.0 + std::abs(y))) return;
    std::printf("%s, row %d: %g is not %g\n", what, row, x, y);
    ++wrong;
}

template <class S, class K>
Rows<S> rows_of(const K& kind, const Motion& m1, const Motion& m2, bool with_residual) {
    pn::Sides<TestPose<S>> s;
    place(m1, s.a);
    place(m2, s.b);
    s.t = 0.0;
    Rows<S> out;
    if constexpr (pn::places<K, pn::Sides<TestPose<S>>, Rows<S>>) {
        kind.place(s, out);
    } else {
        if (with_residual) kind.residual(s, out);
        kind.rows(s, out);
    }
    kind.rate_and_bias(s, out);
    return out;
}

// Rows first_position .. end_position - 1 have a residual whose rate they are (angles are not integrals of turning).
template <class K, class Apart>
void check(const char* name, const K& kind, int first_position, int end_position, Apart apart) {
    for (int trial = 0; trial < 20; ++trial) {
        const Motion m1 = any_motion(), m2 = any_motion();
        if (!apart(m1, m2)) continue;
        const bool positions = end_position > first_position;
        const Rows<double> plain = rows_of<double>(kind, m1, m2, positions);
        const Rows<Dual> dual = rows_of<Dual>(kind, m1, m2, positions);
        for (int k = 0; k < kind.size(); ++k) compare(name, k, dual.rate[k].d, plain.bias[k]);
        for (int k = first_position; k < end_position; ++k) compare(name, k, dual.residual[k].d, plain.rate[k]);
    }
}

template <class K>
void check(const char* name, const K& kind, int first_position, int end_position) {
    check(name, kind, first_position, end_position, [](const Motion&, const Motion&) { return true; });
}

// Where they do not touch: a line that passes through a solid is nearest at a kink.
bool apart(const pn::Hull& hull, double rim, const Motion& m1, const Motion& m2) {
    return rows_of<double>(pn::DiskHullRow{{}, pn::Frame(), pn::Frame(), hull, rim, 0.0}, m1, m2, true).residual[0] > 1e-9;
}
bool apart(const pn::Revolved& solid, double half, const Motion& m1, const Motion& m2) {
    const pn::CapsuleCylinderRow row{{}, pn::Frame(), pn::Frame(), solid, half, 0.0};
    return rows_of<double>(row, m1, m2, true).residual[0] > 1e-9;
}

bool apart(const pn::Revolved& first, const pn::Revolved& second, const Motion& m1, const Motion& m2) {
    const pn::CylinderCylinderRow row{{}, pn::Frame(), pn::Frame(), first, second, 0.0};
    const Vec<double> n = rows_of<double>(row, m1, m2, true).wrench[0].force, e1 = m1.R.c[2], e2 = m2.R.c[2];
    return n.dot(m1.x - m2.x) - first.support(-n.dot(e1), n.cross(e1).norm()) -
           second.support(n.dot(e2), n.cross(e2).norm()) > 1e-9;
}

int main() {
    const pn::Frame f;
    const pn::Vec3 x = pn::Vec3::UnitX(), y = pn::Vec3::UnitY(), z = pn::Vec3::UnitZ();
    check("point", pn::PointRows{{}, f, f, {0, 1, 2}}, 0, 3);
    check("contact", pn::PlanePointRow{{}, f, f, z, 0.1}, 0, 1);
    check("frame", pn::FrameRows{{}, f, f}, 0, 0);
    check("hinge", pn::HingeRows{{}, f, f, z, x, y}, 0, 3);
    check("distance", pn::DistanceRows{{}, f, f, pn::Polynomial{{1.0}}}, 0, 1);
    check("knife", pn::KnifeEdgeRows{{}, f, f, y}, 0, 0);
    check("rolling disk", pn::RollingRows{{}, f, f, 0.2, false, y, x, y, z}, 2, 3);
    check("rolling sphere", pn::RollingRows{{}, f, f, 0.2, true, y, x, y, z}, 2, 3);
    check("hinge slip", pn::HingeSlipRows{{}, f, f, z}, 0, 0);
    check("turn slip", pn::SpinSlipRows{{}, f, f, {0, 1, 2}}, 0, 0);
    check("contact slip", pn::PlanePointSlipRows{{}, f, f, 0.2, x, y, z}, 0, 0);
    for (const double half : {0.05, 0.6, 2.0}) {
        check("box", pn::BoxRow{{}, f, f, pn::Box({half, 0.4, 0.1}), 0.1}, 0, 1);
        check("box slip", pn::BoxSlipRows{{}, f, f, pn::Box({half, 0.4, 0.1}), 0.1}, 0, 0);
    }
    for (const double least : {0.0, 0.05, 0.3}) {
        check("ellipsoid", pn::PlaneRimOrEllipsoidRow{{}, f, f, z, {0.3, 0.4, least}}, 0, 1);
        check("ellipsoid slip", pn::PlaneRimOrEllipsoidSlipRows{{}, f, f, {0.3, 0.4, least}, x, y, z}, 0, 0);
    }
    // A corner with its three faces, and the face across it.
    const double third = 1.0 / std::sqrt(3.0);
    for (const double edge : {0.1, 0.6, 2.0}) {
        const pn::Hull corner({pn::Vec3::Zero(), edge * x, edge * y, edge * z},
                              {-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 0, third, third, third, edge * third},
                              {0, 1, 1, 2, 0, 2, 0, 2, 0, 3, 0, 1, 1, 2, 2, 3, 2, 3, 0, 3, 3, 1, 1, 3});
        check("hull", pn::HullRow{{}, f, f, corner, 0.1}, 0, 1);
        check("hull slip", pn::HullSlipRows{{}, f, f, corner, 0.1}, 0, 0);
        for (const pn::Revolved& solid : {pn::Revolved(edge, 0.4, 0.4), pn::Revolved(edge, 0.4, 0.0)}) {
            check("revolved", pn::RevolvedRow{{}, f, f, solid, 0.1}, 0, 1);
            check("revolved slip", pn::RevolvedSlipRows{{}, f, f, solid, 0.1}, 0, 0);
        }
    }
    // A cube about the middle, its faces numbered by axis and side.
    std::vector<pn::Vec3> corners;
    std::vector<int> edges;
    for (int i = 0; i < 8; ++i) {
        corners.push_back({i & 1 ? 0.5 : -0.5, i & 2 ? 0.5 : -0.5, i & 4 ? 0.5 : -0.5});
        for (int along = 0; along < 3; ++along) {
            const int first = (along + 1) % 3, second = (along + 2) % 3;
            if (i >> along & 1) continue;
            for (int of : {i, i | 1 << along, 2 * first + (i >> first & 1), 2 * second + (i >> second & 1)})
                edges.push_back(of);
        }
    }
    const pn::Hull cube(corners, {-1, 0, 0, 0.5, 1, 0, 0, 0.5, 0, -1, 0, 0.5, 0, 1, 0, 0.5, 0, 0, -1, 0.5, 0, 0, 1, 0.5}, edges);
    for (const double size : {0.1, 0.6, 2.0}) {
        const auto apart_from_cube = [&](const auto&... m) { return apart(cube, size, m...); };
        check("rim", pn::DiskHullRow{{}, f, f, cube, size, 0.1}, 0, 1, apart_from_cube);
        check("rim slip", pn::DiskHullSlipRows{{}, f, f, cube, size}, 0, 0, apart_from_cube);
        for (const double half : {0.0, 0.3, 2.0})
            for (const pn::Revolved& solid : {pn::Revolved(size, 0.4, 0.4), pn::Revolved(size, 0.4, 0.0)}) {
                const auto apart_from_solid = [&](const auto&... m) { return apart(solid, half, m...); };
                check("line", pn::CapsuleCylinderRow{{}, f, f, solid, half, 0.1}, 0, 1, apart_from_solid);
                check("line slip", pn::CapsuleCylinderSlipRows{{}, f, f, solid, half, 0.1}, 0, 0, apart_from_solid);
            }
    }
    const pn::Revolved turned[] = {{0.0, 0.7, 0.7}, {0.6, 0.4, 0.4}, {2.0, 0.3, 0.3}, {0.6, 0.4, 0.0}, {1.0, 0.3, 0.6}};
    for (const pn::Revolved& first : turned)
        for (const pn::Revolved& second : turned) {
            const auto apart_from_other = [&](const auto&... m) { return apart(first, second, m...); };
            check("rims", pn::CylinderCylinderRow{{}, f, f, first, second, 0.1}, 0, 1, apart_from_other);
            check("rims slip", pn::CylinderCylinderSlipRows{{}, f, f, first, second, 0.04, 0.06}, 0, 0, apart_from_other);
        }
    for (const double half1 : {0.0, 0.3, 1.5})
        for (const double half2 : {0.0, 0.4, 2.0}) {
            check("capsules", pn::CapsuleCapsuleRow{{}, f, f, half1, half2, 0.1}, 0, 1);
            check("capsules slip", pn::CapsuleCapsuleSlipRows{{}, f, f, half1, half2, 0.1}, 0, 0);
        }
    return wrong != 0;
}
