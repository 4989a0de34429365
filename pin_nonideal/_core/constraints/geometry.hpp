// Frames, their placements and motions, and unit wrenches, in which constraints between two bodies are written.
#pragma once

#include <memory>

#include "tree/terms.hpp"

namespace pn {

struct Frame {  // a frame fixed to the body of a joint (0: the world)
    int joint = 0;
    Mat3 R = Mat3::Identity();
    Vec3 p = Vec3::Zero();
};

// Frame of a constraint, by default the world's. The contacts of the features of two bodies share frames.
class SharedFrame {
public:
    SharedFrame() : frame_(world()) {}
    SharedFrame(const Frame& frame) : frame_(std::make_shared<const Frame>(frame)) {}
    operator const Frame&() const { return *frame_; }
    const Frame* operator->() const { return frame_.get(); }
    const Frame* get() const { return frame_.get(); }

private:
    static const std::shared_ptr<const Frame>& world() {
        static const auto frame = std::make_shared<const Frame>();
        return frame;
    }

    std::shared_ptr<const Frame> frame_;
};

// Wrench: force at a point of the world, and couple.
template <class Vec>
struct WrenchOf {
    Vec force, point, couple;
};
using Wrench = WrenchOf<Vec3>;

template <class Vec>
PN_INLINE WrenchOf<Vec> force_at(const Vec& point, const Vec& force) { return {force, point, Vec()}; }
template <class Vec>
PN_INLINE WrenchOf<Vec> couple_at(const Vec& point, const Vec& couple) { return {Vec(), point, couple}; }

struct Pose {  // placement of a frame in the world, and motion of the points of its body
    using Vec = Vec3;
    using Scalar = double;

    const Body& body;
    Mat3 R;
    Vec3 x;
    const Mechanism& m;

    PN_INLINE Pose(const Mechanism& mechanism, const Terms& terms, const Frame& f)
        : body(terms.body[f.joint]), R(f.R), x(f.p), m(mechanism) {
        if (f.joint == 0) return;  // fixed to the world
        R = body.R * f.R;
        x = body.ref + body.p + body.R * f.p;
    }
    PN_INLINE const Vec3& omega() const { return body.v.ang; }
    PN_INLINE const Vec3& alpha() const { return body.a.ang; }
    PN_INLINE Vec3 velocity(const Vec3& at) const { return velocity_at(body, at); }
    PN_INLINE Vec3 acceleration(const Vec3& at) const { return acceleration_at(m, body, at); }
};

// Both sides of a constraint at time t, for any scalar type. Kinds read nothing else, so other scalars (such as dual
// numbers) need no second copy of the formulas.
template <class PoseType>
struct Sides {
    using Pose = PoseType;
    using Vec = typename Pose::Vec;
    using Scalar = typename Pose::Scalar;
    Pose a, b;
    double t;
};

// Velocity of frame 1's origin relative to body 2, and its rate at zero acceleration.
template <class Pose>
struct PointMotion {
    using Vec = typename Pose::Vec;
    Vec u, du;

    PN_INLINE explicit PointMotion(const Sides<Pose>& s) {
        u = s.a.velocity(s.a.x) - s.b.velocity(s.a.x);
        du = s.a.acceleration(s.a.x) - s.b.acceleration(s.a.x) - 2.0 * s.b.omega().cross(u);
    }
    // Set row k to the component along e, which is fixed in body 2.
    template <class Out>
    PN_INLINE void row(Out& out, int k, const Vec& e) const {
        out.rate[k] = e.dot(u);
        out.bias[k] = e.dot(du);
    }
};

// Set row k to the sliding of body 1 against body 2 along e, which is fixed in body 2. The contact point c moves with
// the rate c_rate.
template <class Pose, class Out, class Vec>
PN_INLINE void sliding_row(const Sides<Pose>& s, Out& out, int k, const Vec& e, const Vec& c, const Vec& c_rate) {
    const Vec va = s.a.velocity(c), vb = s.b.velocity(c), u = va - vb;
    const Vec du = s.a.acceleration(c) + s.a.omega().cross(c_rate - va) - s.b.acceleration(c) -
                    s.b.omega().cross(c_rate - vb) - s.b.omega().cross(u);
    out.rate[k] = e.dot(u);
    out.bias[k] = e.dot(du);
}

}  // namespace pn
