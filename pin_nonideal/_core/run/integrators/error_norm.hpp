// Size of an error in a state beside what the tolerances allow, and the first step that they suggest.
#pragma once

#include "run/integrators/system.hpp"

namespace pn {

class ErrorNorm {
public:
    // atol by tangent coordinate, velocity and state of a law; so is the rounding of their rates, below which nothing is
    // asked for.
    ErrorNorm(System& system, double rtol, const VecX& atol, const VecX& rounding);

    // Errors that a step of size h between these states may make.
    void set_tolerances(const VecX& y0, const VecX& y1, double h);
    // Whether rounding makes more than the tolerances allow.
    bool is_limited() const { return limited_; }
    // Raises the rounding of each rate to the size of dy.
    void raise(VecX& rounding, const VecX& dy, const VecX& y);
    // Root mean square of dy at y, each coordinate as a part of its tolerance.
    double operator()(const VecX& dy, const VecX& y);
    // The same of a move of positions, and of velocities where stages are not projected, by which a projection has put a
    // step's end back; no part of it is removed.
    double of_projection(const VecX& dy, const VecX& y0, const VecX& y1, double t, double h);
    // A speed as a part of the tolerance of the largest velocity, which set_tolerances has set.
    double of_speed(double speed) const;
    // Step of a method of this order from y, where the rate is dy; `limit` at most. Leaves the workspace elsewhere.
    double initial_step(int order, double t, const VecX& y, const VecX& dy, double limit);

private:
    // dy at y in tangent coordinates.
    void to_tangent(const VecX& dy, const VecX& y);
    // Raises magnitudes to those of tangent coordinates, velocities and states at y.
    void magnitude(const VecX& y);

    System& system_;
    double rtol_, share_tolerance_ = 1.0;
    bool resolves_shares_ = true;  // of contacts, in a step so long
    VecX atol_, tolerance_, tangent_;
    const VecX& rounding_;
    bool limited_ = false;
};

}  // namespace pn
