// Newton's method on the modes of a cone problem, in the functions of Alart and Curnier ("A mixed formulation for
// frictional contact problems prone to Newton like solution methods", 1991). With tau = f_n - rho w_n and z = f_t - rho
// w_t, a contact has f_n = max(0, tau). f_t is the nearest point to z of the disk of radius mu tau.
#pragma once

#include "complementarity/cone/problem.hpp"

namespace pn {

struct ConeNewtonParameters {
    // Error that ends the iteration, and error that ends the iteration if steps make no progress.
    double tolerance = 1e-15, stall_tolerance = 1e-11;
    double decrease = 1e-4;     // required fraction of the predicted decrease
    int max_halvings = 7;       // maximum halvings of a step that does not decrease the squared error
    int max_blind_steps = 3;    // steps without decrease that let the modes change
    int max_stalled_steps = 2;  // steps at rounding without progress
};

class ConeNewton {
public:
    using Parameters = ConeNewtonParameters;
    static constexpr Parameters parameters{};

    // Iterate from f, and set f to the best point found. Return the largest relative error of the equations.
    double solve(const ConeProblem& problem, Eigen::Ref<VecX> f, int max_steps);
    // Return the relative error of f.
    double error(const ConeProblem& problem, const Eigen::Ref<const VecX>& f);
    bool regular() const { return regular_; }  // the last equations had full rank
    // Return the sign of the determinant of the equations at f, or 0 if it is rounding error.
    int orientation(const ConeProblem& problem, const Eigen::Ref<const VecX>& f);
    int steps() const { return steps_; }       // total of all calls

private:
    double evaluate(const ConeProblem& problem, const Eigen::Ref<const VecX>& f);
    double relative(const ConeProblem& problem, const Eigen::Ref<const VecX>& f);
    void differentiate(const ConeProblem& problem, const Eigen::Ref<const VecX>& f);
    bool advance(const ConeProblem& problem, Eigen::Ref<VecX> f, double& merit);
    bool update_modes(const ConeProblem& problem, const Eigen::Ref<const VecX>& f);

    DenseSolver solver_;
    Buffer J_, F_, w_, step_, ahead_, best_, size_;
    std::vector<signed char> mode_;  // per element: mode of the factored equations, if these are linear
    bool regular_ = false;
    int steps_ = 0, blind_ = 0;
};

}  // namespace pn
