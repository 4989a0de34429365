// Spatial quantities of rigid bodies, all in world axes about a reference point (one per kinematic tree).
// A motion is (velocity of the body point at the reference, angular velocity); a force is (force, moment about it).
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace pn {

using Vec3 = Eigen::Vector3d;
using Mat3 = Eigen::Matrix3d;
using VecX = Eigen::VectorXd;
using MatX = Eigen::MatrixXd;

struct Motion {
    Vec3 lin, ang;
    Motion& operator+=(const Motion& o) { lin += o.lin; ang += o.ang; return *this; }
};

struct Force {
    Vec3 lin, ang;
    Force& operator+=(const Force& o) { lin += o.lin; ang += o.ang; return *this; }
};

inline Motion operator*(double s, const Motion& m) { return {s * m.lin, s * m.ang}; }
inline Motion operator+(const Motion& a, const Motion& b) { return {a.lin + b.lin, a.ang + b.ang}; }

// Power of a force on a motion.
inline double dot(const Motion& m, const Force& f) { return m.lin.dot(f.lin) + m.ang.dot(f.ang); }

// Rate of change of a motion b carried by v, and of a force f carried by v.
inline Motion cross(const Motion& v, const Motion& b) {
    return {v.ang.cross(b.lin) + v.lin.cross(b.ang), v.ang.cross(b.ang)};
}
inline Force cross(const Motion& v, const Force& f) {
    return {v.ang.cross(f.lin), v.ang.cross(f.ang) + v.lin.cross(f.lin)};
}

// Rigid-body inertia about the reference point: mass, first moment, second moment.
struct Inertia {
    double mass = 0.0;
    Vec3 first = Vec3::Zero();
    Mat3 second = Mat3::Zero();

    Inertia& operator+=(const Inertia& o) {
        mass += o.mass;
        first += o.first;
        second += o.second;
        return *this;
    }
    Force operator*(const Motion& m) const {
        return {mass * m.lin - first.cross(m.ang), second * m.ang + first.cross(m.lin)};
    }
};

}  // namespace pn
