#include "tree/lie_group.hpp"

#include <cmath>

namespace pn {

namespace {

using Quat = Eigen::Quaterniond;
using Vector = Eigen::Vector3d;

Quat quaternion(const double* q) { return Quat(q[3], q[0], q[1], q[2]); }

// q' = q * (w, 0) / 2 for an angular velocity w in body axes.
void quaternion_rate(const double* q, const double* w, double* dq) {
    dq[0] = 0.5 * (q[3] * w[0] + q[1] * w[2] - q[2] * w[1]);
    dq[1] = 0.5 * (q[3] * w[1] + q[2] * w[0] - q[0] * w[2]);
    dq[2] = 0.5 * (q[3] * w[2] + q[0] * w[1] - q[1] * w[0]);
    dq[3] = -0.5 * (q[0] * w[0] + q[1] * w[1] + q[2] * w[2]);
}

// w with q' = q * (w, 0) / 2, for dq tangent to the unit sphere.
void quaternion_tangent(const double* q, const double* dq, double* w) {
    const Vector a(q[0], q[1], q[2]), d(dq[0], dq[1], dq[2]);
    Eigen::Map<Vector>{w} = 2.0 * (q[3] * d - dq[3] * a - a.cross(d));
}

// Angles below which the truncated series is exact to rounding, but the quotient of small numbers is not.
constexpr double small_half_angle = 1e-8, small_angle = 1e-4, small_cubic_angle = 1e-2;

Quat exponential(const Vector& w) {
    const double angle = w.norm();
    const double s = angle < small_half_angle ? 0.5 - angle * angle / 48.0 : std::sin(0.5 * angle) / angle;
    return Quat(std::cos(0.5 * angle), s * w[0], s * w[1], s * w[2]);
}

// sin(x)/x, (1 - cos x)/x^2 and (x - sin x)/x^3 with their series near zero.
double sinc(double x) { return std::abs(x) < small_angle ? 1.0 - x * x / 6.0 : std::sin(x) / x; }
double versine(double x) { return std::abs(x) < small_angle ? 0.5 - x * x / 24.0 : (1.0 - std::cos(x)) / (x * x); }
double cubic(double x) {
    if (std::abs(x) < small_cubic_angle) return 1.0 / 6.0 - x * x / 120.0 + x * x * x * x / 5040.0;
    return (x - std::sin(x)) / (x * x * x);
}

// Segment of a chart with unit length: a quaternion or (cos, sin), or none.
struct ChartSegment { int first, n; };
ChartSegment unit_segment(const Chart& c) {
    switch (c.kind) {
        case Chart::Kind::circle: return {c.iq, 2};
        case Chart::Kind::quaternion: return {c.iq, 4};
        case Chart::Kind::plane: return {c.iq + 2, 2};
        case Chart::Kind::pose: return {c.iq + 3, 4};
        default: return {c.iq, 0};
    }
}

void store(const Quat& q, double* out) {
    const Quat n = q.normalized();
    out[0] = n.x(); out[1] = n.y(); out[2] = n.z(); out[3] = n.w();
}

}  // namespace

void configuration_rate(const Mechanism& m, const double* q, const double* v, double* dq) {
    for (const Chart& c : m.charts) {
        const double *x = q + c.iq, *w = v + c.iv;
        double* d = dq + c.iq;
        switch (c.kind) {
            case Chart::Kind::vector:
                for (int k = 0; k < c.n; ++k) d[k] = w[k];
                break;
            case Chart::Kind::circle:
                d[0] = -x[1] * w[0];
                d[1] = x[0] * w[0];
                break;
            case Chart::Kind::quaternion: quaternion_rate(x, w, d); break;
            case Chart::Kind::plane:
                d[0] = x[2] * w[0] - x[3] * w[1];
                d[1] = x[3] * w[0] + x[2] * w[1];
                d[2] = -x[3] * w[2];
                d[3] = x[2] * w[2];
                break;
            case Chart::Kind::pose:
                Eigen::Map<Vector>{d} = quaternion(x + 3).normalized() * Eigen::Map<const Vector>{w};
                quaternion_rate(x + 3, w + 3, d + 3);
                break;
        }
    }
}

void normalize(const Mechanism& m, double* q) {
    for (const Chart& c : m.charts) {
        const ChartSegment unit = unit_segment(c);
        if (unit.n == 0) continue;
        Eigen::Map<VecX> part(q + unit.first, unit.n);
        const double square = part.squaredNorm();
        if (square != 1.0) part /= std::sqrt(square);
    }
}

bool has_unit_lengths(const Mechanism& m, const double* q, double tolerance) {
    for (const Chart& c : m.charts) {
        const ChartSegment unit = unit_segment(c);
        if (unit.n == 0) continue;
        if (!(std::abs(Eigen::Map<const VecX>(q + unit.first, unit.n).norm() - 1.0) <= tolerance)) return false;
    }
    return true;
}

void ambient_to_tangent(const Mechanism& m, const double* q, const double* dq, double* tangent) {
    for (const Chart& c : m.charts) {
        const double *x = q + c.iq, *d = dq + c.iq;
        double* w = tangent + c.iv;
        switch (c.kind) {
            case Chart::Kind::vector:
                for (int k = 0; k < c.n; ++k) w[k] = d[k];
                break;
            case Chart::Kind::circle: w[0] = x[0] * d[1] - x[1] * d[0]; break;
            case Chart::Kind::quaternion: quaternion_tangent(x, d, w); break;
            case Chart::Kind::plane:
                w[0] = x[2] * d[0] + x[3] * d[1];
                w[1] = -x[3] * d[0] + x[2] * d[1];
                w[2] = x[2] * d[3] - x[3] * d[2];
                break;
            case Chart::Kind::pose:
                Eigen::Map<Vector> lin(w);
                lin = quaternion(x + 3).normalized().conjugate() * Eigen::Map<const Vector>{d};
                quaternion_tangent(x + 3, d + 3, w + 3);
                break;
        }
    }
}

void retract(const Mechanism& m, const double* q, const double* v, double* out) {
    for (const Chart& c : m.charts) {
        const double *x = q + c.iq, *w = v + c.iv;
        double* y = out + c.iq;
        switch (c.kind) {
            case Chart::Kind::vector:
                for (int k = 0; k < c.n; ++k) y[k] = x[k] + w[k];
                break;
            case Chart::Kind::circle: {
                const double cs = std::cos(w[0]), sn = std::sin(w[0]), a = x[0], b = x[1];
                y[0] = a * cs - b * sn;
                y[1] = a * sn + b * cs;
                break;
            }
            case Chart::Kind::quaternion: store(quaternion(x) * exponential(Vector(w[0], w[1], w[2])), y); break;
            case Chart::Kind::plane: {
                const double s = sinc(w[2]), u = versine(w[2]) * w[2], a = x[2], b = x[3];
                const double lx = s * w[0] - u * w[1], ly = u * w[0] + s * w[1];
                const double px = x[0] + a * lx - b * ly, py = x[1] + b * lx + a * ly;
                const double cs = std::cos(w[2]), sn = std::sin(w[2]);
                y[0] = px;
                y[1] = py;
                y[2] = a * cs - b * sn;
                y[3] = a * sn + b * cs;
                break;
            }
            case Chart::Kind::pose: {
                const Vector lin(w[0], w[1], w[2]), ang(w[3], w[4], w[5]);
                const double angle = ang.norm();
                const Vector cr = ang.cross(lin);
                const Vector step = lin + versine(angle) * cr + cubic(angle) * ang.cross(cr);
                const Quat rot = quaternion(x + 3);
                const Vector p = Eigen::Map<const Vector>{x} + rot.normalized() * step;
                store(rot * exponential(ang), y + 3);
                Eigen::Map<Vector>{y} = p;
                break;
            }
        }
    }
}

}  // namespace pn
