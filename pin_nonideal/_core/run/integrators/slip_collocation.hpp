// Steps with slip directions as unknowns.
//
// If friction nearly balances the load, slip is slow relative to the effect of a change of its direction n. With the
// slip velocity u = sigma n and du/dt = alpha0 - W s n, deviations of n decay at the rate W s / sigma, without bound as
// sigma goes to zero. This happens at every onset of slip from rest without a drop of the limit, where u grows with the
// square of time. The slow motion itself is smooth. Collocation at Radau points (Radau IIA, seven stages) follows it in
// steps that its loads allow. The method needs no rate at the step's start. Friction that opposes slip can only shrink
// the distance of two of its solutions (algebraic stability).
// Unknowns of every stage are the state, sigma (negative past a reversal) and n, not u. No equation is divided by a
// slip speed. Forces other than friction are iterated.
// [Hairer, Wanner, "Solving Ordinary Differential Equations II", sec. IV.5, IV.12]
#pragma once

#include "run/integrators/error_norm.hpp"
#include "run/integrators/step.hpp"

namespace pn {

struct CollocationParameters {
    int max_iterations = 14;     // maximum iterations of a step, each an evaluation at all stages
    double farthest_turn = 1.5;  // largest turn of a direction in the first iteration, else the step is too long
    // Convergence, relative to the tolerance: sum of the remaining changes, or the first change alone.
    double solved_part = 0.05, solved_at_once = 0.005;
    double diverging = 0.9, diverging_first = 3.0;  // ratio of two changes at which the iteration stops
    double rounding_part = 0.5;    // relative to the tolerance: smaller changes that no longer shrink are rounding error
    double perturbation = 1e-6;    // step of a direction for its response: above the root of the rounding error
    double rank_threshold = 1e-5;  // relative rank threshold: slip at rest does not determine the turn of its direction
};

class Collocation {
public:
    using Parameters = CollocationParameters;
    static constexpr Parameters parameters{};

    static constexpr int stages = 7;

    Collocation(Step& step, System& system, ErrorNorm& norm);

    // Check if any element slips in several directions.
    bool has_directions();
    // Compute y1 from y0 and the rate at y0. The workspace then holds the directions of the step's end.
    void advance();
    // Check if the equations of the stages were solved.
    bool is_solved() const { return converged_ || step_.h == 0.0; }
    // Return the norm of the error estimate, 1 at the tolerance. The estimate uses the rate at the step's start, which the
    // stages do not use. Return `failed_error` if the equations of the stages were not solved.
    double error();
    // Fastest relaxation rate of a direction at the step's end, times the step.
    double stiffness() const { return stiffness_; }
    // Discard the warm start.
    void reset_warm_start() { has_warm_start_ = false; }

    // Abscissa of a stage in the step, and its rate.
    static double abscissa(int stage);
    const VecX& rate(int stage) const { return F_[stage]; }
    // Compute the state inside the step. The workspace then holds the directions there.
    void interpolate(double part, VecX& y) const;
    double interpolated(double part, int index) const;
    double interpolated_rate(double part, int index) const;
    void set_directions_at(double part) const;

private:
    struct Element {
        int index, dim, row, tangent;  // index in the program, size, first row and first tangent among all elements
    };

    void gather();
    void stretch();
    void extrapolate_straight();
    void set_directions(int stage) const;
    void evaluate_stages(bool first);
    void find_response();
    void correct();
    void solve_turns();
    void turn_directions();
    void move_stages();
    double change();
    bool diverges(int iteration, double now, double last) const;
    bool has_converged(int iteration, double now, double last) const;
    void measure_stiffness();
    void add_tangents(int stage);

    Step& step_;
    System& system_;
    ErrorNorm& norm_;
    std::vector<Element> elements_;
    int rows_ = 0, tangents_ = 0;
    bool has_warm_start_ = false, converged_ = false;
    double stiffness_ = 0.0, warm_start_size_ = 0.0;
    std::vector<VecX> F_, Y_, next_;  // rates, states and next states of the stages
    std::vector<VecX> u_, n_;         // slip velocities and directions of all elements, per stage
    std::vector<VecX> turned_;        // change of the accelerations by the last turns
    VecX start_n_, n_before_;
    MatX sigma_;                      // slip speeds, (elements, stages)
    std::vector<MatX> A_;             // rows of the slip velocities per stage
    MatX G_;                          // da/dn, including the loads that follow n
    std::vector<MatX> T_, P_, Q_;     // tangents to n, T^T A, G T per stage
    MatX K_;
    VecX turn_, residual_, error_;
};

}  // namespace pn
