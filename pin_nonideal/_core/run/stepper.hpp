// A step of the method that a run was asked for; which stepper takes it is chosen once.
#pragma once

#include <variant>

#include "run/error_norm.hpp"
#include "run/outside_step.hpp"
#include "run/runge_kutta.hpp"
#include "run/semi_implicit_euler.hpp"

namespace pn {

class Stepper : public Step {
public:
    Stepper(const Method& method, System& system);

    const Method& method;

    // y1 = one step of size h from (t0, y0); the rate there must be known.
    void take(double t, double size);
    // Moves the end by a time so short that the rate there, which must be known, does not change. The interpolant is lost.
    void move_end(double dt);
    // The step from t that an integrator outside has taken, and the rates inside it.
    void follow(double t, double size, OutsideStep::Interpolant interpolant);
    // Norm of the error estimate, 1 at the tolerance; 0 of methods without one.
    double error(ErrorNorm& norm);
    // What the method's last stage was evaluated at, until there is an interpolant; of explicit Runge-Kutta methods.
    const VecX& last_stage() const { return std::get<RungeKutta>(scheme_).last_stage(); }
    // What the projection of the end of an accepted step has shown, for methods that use it.
    void learn();

    // Interpolant over the step; needs the rate at its end. Leaves the workspace at other states.
    void make_interpolant();
    void interpolate(double part, VecX& y) const;
    // One number of it (lengths that must be one are not restored), and its rate.
    double interpolated(double part, int index) const;
    double interpolated_rate(double part, int index) const;
    bool has_interpolant() const { return has_interpolant_; }

private:
    System& system_;
    std::variant<std::monostate, RungeKutta, SemiImplicitEuler, OutsideStep> scheme_;
    bool has_interpolant_ = false;
};

}  // namespace pn
