// Steps in which directions of slip are unknowns.
//
// Where friction nearly balances the load, slip is slow beside what a change of its direction n would do: with the slip
// velocity u = sigma n and du/dt = alpha0 - W s n, deviations of n die at the rate W s / sigma, without bound as sigma
// goes to zero. So it is at every onset of slip from rest without a drop of the limit, where u grows with the square of
// time. The slow motion itself is smooth: collocation at Radau's points (Radau IIA, seven stages) follows it in steps
// that its loads ask for. It needs no rate at the step's start, and friction that opposes slip can only shrink the
// distance of two of its solutions (algebraic stability). Unknowns of every stage are the state, sigma (negative past a
// reversal) and n, not u, so that nothing is divided by a slip speed; forces other than friction's are iterated.
// [Hairer, Wanner, "Solving Ordinary Differential Equations II", sec. IV.5, IV.12]
#pragma once

#include "run/integrators/error_norm.hpp"
#include "run/integrators/step.hpp"

namespace pn {

class Collocation {
public:
    static constexpr int stages = 7;

    Collocation(Step& step, System& system, ErrorNorm& norm);

    // y1, from y0 and the rate there; the workspace then holds the directions of the step's end.
    void advance();
    // Whether the equations of the stages were solved.
    bool is_solved() const { return converged_ || step_.h == 0.0; }
    // Norm of the error estimate, 1 at the tolerance, from the rate at the start that the stages do not know; that of a
    // failed step where their equations were not solved.
    double error();
    // Fastest rate at which a direction relaxes at the step's end, times the step.
    double stiffness() const { return stiffness_; }
    // A new step: what was found in the last one is no guess for it.
    void forget() { known_ = false; }

    // Where in the step a stage stands, and its rate.
    static double part(int stage);
    const VecX& rate(int stage) const { return F_[stage]; }
    // The state inside the step; the workspace takes the directions there.
    void interpolate(double part, VecX& y) const;
    double interpolated(double part, int index) const;
    double interpolated_rate(double part, int index) const;
    void take_directions_at(double part) const;

private:
    struct Element {
        int index, dim, row, tangent;  // of the program; of its rows and tangents among those of all
    };

    void gather();
    void stretch();
    void go_straight_on();
    void take_directions(int stage) const;
    void evaluate_stages(bool first);
    void find_response();
    void correct();
    void solve_turns();
    void turn_directions();
    void move_stages();
    double change();
    void measure_stiffness();
    void add_tangents(int stage);

    Step& step_;
    System& system_;
    ErrorNorm& norm_;
    std::vector<Element> elements_;
    int rows_ = 0, tangents_ = 0;
    bool known_ = false, converged_ = false;
    double stiffness_ = 0.0, known_size_ = 0.0;
    std::vector<VecX> F_, Y_, next_;  // rates and states of the stages, and states to come
    std::vector<VecX> u_, n_;         // slip velocities and directions of all elements, by stage
    std::vector<VecX> turned_;        // what the last turns added to the accelerations
    VecX start_n_;
    MatX sigma_;                      // slip speeds: element by stage
    std::vector<MatX> A_;             // rows of the slip velocities by stage
    MatX G_;                          // da/dn, loads and all
    std::vector<MatX> T_, P_, Q_;     // tangents to n, T^T A, G T by stage
    MatX K_;
    VecX turn_, residual_, error_;
};

}  // namespace pn
