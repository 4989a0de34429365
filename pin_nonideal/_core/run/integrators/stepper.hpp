// A step of the method that a run was asked for; which stepper takes it is chosen once.
#pragma once

#include <variant>

#include "run/integrators/radau_slip.hpp"
#include "run/integrators/external_step.hpp"
#include "run/integrators/runge_kutta.hpp"
#include "run/integrators/semi_implicit_euler.hpp"

namespace pn {

class Stepper : public Step {
public:
    Stepper(const Method& method, System& system, ErrorNorm& norm);

    const Method& method;

    // y1 = one step of size h from (t0, y0); the rate there must be known. The step stands still where it is not solved.
    void take(double t, double size);
    // Moves the end by a time so short that the rate there, which must be known, does not change. The interpolant is lost.
    void move_end(double dt);
    // The same step, of another length. Throws a Failure where it is not solved.
    void take_again(double size);
    // The step from t that an integrator outside has taken, and the rates inside it.
    void follow(double t, double size, OutsideStep::Interpolant interpolant);
    // Norm of the error estimate, 1 at the tolerance; 0 of methods without one.
    double error();
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

    // Whether the step sought the directions of slip by collocation, and where that has to go on for a time.
    bool collocates() const { return collocates_; }
    // How fast directions of slip, or any velocity as the stages of another method see it, relax beside the step.
    double stiffness() const;
    // Back to the directions of the step's end, after looking into it; and the step is done.
    void end_directions() const { if (collocates_) collocation_.take_directions_at(1.0); }
    void forget() { collocation_.forget(); }

    // Where rates are known in the step just taken: at its start, at stages before its end, and there; in time.
    struct Look {
        double part;
        const VecX* rate;
    };
    const std::vector<Look>& looks() const { return collocates_ ? collocation_looks_ : looks_; }

private:
    System& system_;
    ErrorNorm& norm_;
    std::variant<std::monostate, RungeKutta, SemiImplicitEuler, OutsideStep> scheme_;
    Collocation collocation_;
    std::vector<Look> looks_, collocation_looks_;
    bool has_interpolant_ = false, collocates_ = false;
};

}  // namespace pn
