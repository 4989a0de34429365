#include "dynamics/parameters.hpp"

#include <initializer_list>
#include <stdexcept>
#include <utility>

namespace pn {

namespace {

[[noreturn]] void refuse(const NumberName& name) {
    throw std::invalid_argument(name.call + ": " + name.argument);
}

template <class T>
using Members = std::initializer_list<std::pair<const char*, double T::*>>;

template <class T>
NumberLocation member(T& of, const NumberName& name, Members<T> members) {
    for (const auto& [argument, at] : members)
        if (name.argument == argument) return {&(of.*at), 1};
    refuse(name);
}

// Return item number `index` of a kind of description. Sorting by kind keeps the order of insertion.
template <class Kind, class Several>
Kind& nth(Several& several, const NumberName& name) {
    int k = name.index;
    for (auto& each : several)
        if (auto* kind = std::get_if<Kind>(&each); kind && k-- == 0) return *kind;
    refuse(name);
}

NumberLocation vector(Vec3& x) { return {reinterpret_cast<double*>(&x.x), 3}; }
NumberLocation vector(VecX& x) { return {x.data(), static_cast<int>(x.size())}; }

NumberLocation of_law(Program& p, const NumberName& name) {
    using F = Friction;
    if (name.call == "add_friction")
        return member(p.frictions.at(name.index), name,
                      {{"constant", &F::constant}, {"mu", &F::mu}, {"radius", &F::radius},
                       {"axial_radius", &F::axial_radius}, {"inverse_span", &F::inverse_span},
                       {"static_ratio", &F::static_ratio}, {"stribeck_velocity", &F::stribeck_velocity}});
    if (name.call == "add_viscous")
        return member(nth<Viscous>(p.laws, name), name, {{"coefficient", &Viscous::coefficient}});
    if (name.call == "add_drag")
        return member(nth<Drag>(p.laws, name), name, {{"coefficient", &Drag::coefficient}, {"exponent", &Drag::exponent}});
    if (name.call == "add_sigmoid")
        return member(nth<Sigmoid>(p.laws, name), name,
                      {{"phi1", &Sigmoid::phi1}, {"phi2", &Sigmoid::phi2}, {"phi3", &Sigmoid::phi3}});
    using L = LuGre;
    return member(nth<L>(p.laws, name), name,
                  {{"stiffness", &L::sigma0}, {"damping", &L::sigma1}, {"viscous", &L::sigma2}, {"coulomb", &L::coulomb},
                   {"stiction", &L::stiction}, {"stribeck_velocity", &L::stribeck_velocity}});
}

NumberLocation of_force(Program& p, const NumberName& name) {
    using S = SpringDamper;
    using J = JointSpring;
    if (name.call == "add_spring_damper")
        return member(nth<S>(p.forces, name), name,
                      {{"stiffness", &S::stiffness}, {"damping", &S::damping}, {"rest_length", &S::rest_length}});
    if (name.call == "add_joint_spring")
        return member(nth<J>(p.forces, name), name,
                      {{"stiffness", &J::stiffness}, {"rest", &J::rest}, {"damping", &J::damping}});
    if (name.call == "add_wrench" && name.argument == "value") return {nth<FrameWrench>(p.forces, name).value, 6};
    if (auto* constant = std::get_if<ConstantTorque>(&p.actuation); constant && name.call == "set_constant_torque")
        return vector(constant->tau);
    if (auto* hold = std::get_if<HoldPosition>(&p.actuation); hold && name.call == "set_hold_position")
        return vector(name.argument == "kp" ? hold->kp : name.argument == "kd" ? hold->kd : hold->q);
    refuse(name);
}

}  // namespace

NumberLocation find_number(Program& p, const NumberName& name) {
    if (name.call == "gravity") return vector(p.mechanism.gravity);
    if (name.call == "body") {
        Joint& joint = p.mechanism.joints.at(name.index);
        if (name.argument == "mass") return {&joint.mass, 1};
        if (name.argument == "com") return vector(joint.com);
        return vector(joint.inertia.c[name.argument == "inertia x" ? 0 : name.argument == "inertia y" ? 1 : 2]);
    }
    if (name.call == "set_unilateral") return member(p.gaps.at(name.index), name, {{"restitution", &Gap::restitution}});
    for (const char* law : {"add_friction", "add_viscous", "add_drag", "add_sigmoid", "add_lugre"})
        if (name.call == law) return of_law(p, name);
    return of_force(p, name);
}

}  // namespace pn
