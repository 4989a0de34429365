// Applied forces in F beside the bias: springs, wrenches, user-defined forces and actuation torques.
#pragma once

#include <functional>
#include <variant>
#include <vector>

#include "constraints/geometry.hpp"

namespace pn {

struct Program;
struct Workspace;

// `acts_on_bodies` is true for forces on bodies and false for forces on joints. `calls_function` is true if a user's
// function gives the force. Such a force may change while nothing moves.
struct SpringDamper {
    Frame frame1, frame2;
    double stiffness = 0.0, damping = 0.0, rest_length = 0.0;
    static constexpr bool acts_on_bodies = true;
    bool calls_function() const { return false; }
};
struct JointSpring {
    int joint = 0;
    double stiffness = 0.0, rest = 0.0, damping = 0.0;
    static constexpr bool acts_on_bodies = false;
    bool calls_function() const { return false; }
};
struct FrameWrench {
    Frame frame;
    std::function<void(double t, double* six)> function;  // empty: constant
    double value[6] = {};
    static constexpr bool acts_on_bodies = true;
    bool calls_function() const { return static_cast<bool>(function); }
};
struct UserForce {
    std::function<void(double t, const VecX& q, const VecX& v, VecX& force)> function;
    static constexpr bool acts_on_bodies = false;
    bool calls_function() const { return true; }
};
using GivenForce = std::variant<SpringDamper, JointSpring, FrameWrench, UserForce>;

struct NoActuation {};
struct ConstantTorque { VecX tau; };
struct TorqueFunction { std::function<void(double t, const VecX& q, const VecX& v, VecX& tau)> function; };
struct SampledTorque {
    std::function<void(double t, const VecX& q, const VecX& v, VecX& tau)> function;
    double period;
};
struct HoldPosition { VecX kp, kd, q; };
// Torques at increasing times, one column per time. The torques are linear between these times and constant outside.
struct TorqueTable {
    std::vector<double> times;
    MatX values;
};
using Actuation = std::variant<NoActuation, ConstantTorque, TorqueFunction, SampledTorque, HoldPosition, TorqueTable>;

}  // namespace pn
