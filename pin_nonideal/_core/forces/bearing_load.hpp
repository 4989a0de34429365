// Load of a bearing under the wrench that its joint or anchor carries: a sum of lengths of vectors that are linear in the
// wrench, each times a coefficient.
#pragma once

#include <array>

#include "forces/friction.hpp"

namespace pn {

// Vectors whose lengths add up to the load-dependent part of a limit. Vectors that a bearing type does not use are zero.
// The second vector is linear in the moment of the wrench, the first and third in its force.
using LoadVectors = std::array<Vec3, 3>;

struct BearingLoad {
    LoadVectors vectors;
    std::array<double, 3> coefficients;

    // Bearing of an element under a wrench about the origin of its joint or anchor. The axis is the bearing's.
    PN_INLINE BearingLoad(const Friction& f, const Vec3& axis, const Force& r) : coefficients{} {
        using Load = Friction::Load;
        const double rub = f.mu * f.radius;
        const Vec3 axial = r.lin.dot(axis) * axis, radial = r.lin - axial, bending = r.ang - r.ang.dot(axis) * axis;
        if (f.load == Load::spherical) set({r.lin, Vec3::Zero(), Vec3::Zero()}, {rub, 0.0, 0.0});
        if (f.load == Load::prismatic) set({radial, r.ang, Vec3::Zero()}, {f.mu, f.mu * f.inverse_span, 0.0});
        if (f.load == Load::planar) set({axial, bending, Vec3::Zero()}, {f.mu, f.mu * f.inverse_span, 0.0});
        if (f.load == Load::revolute) set({radial, bending, axial}, {rub, rub * f.inverse_span, f.mu * f.axial_radius});
    }

    PN_INLINE double size() const {
        double sum = 0.0;
        for (int k = 0; k < 3; ++k)
            if (coefficients[k] != 0.0) sum += vectors[k].norm();
        return sum;
    }
    // Derivative by the wrench of the size, the sum of coefficients times lengths. The size is homogeneous: its
    // derivative times the wrench is the size.
    PN_INLINE Motion gradient() const {
        Vec3 along[3];
        for (int k = 0; k < 3; ++k) {
            const double length = coefficients[k] != 0.0 ? vectors[k].norm() : 0.0;
            if (length > 0.0) along[k] = (coefficients[k] / length) * vectors[k];
        }
        return {along[0] + along[2], along[1]};
    }

private:
    PN_INLINE void set(const LoadVectors& parts, const std::array<double, 3>& factors) {
        coefficients = factors;
        for (int k = 0; k < 3; ++k) vectors[k] = coefficients[k] * parts[k];
    }
};

}  // namespace pn
