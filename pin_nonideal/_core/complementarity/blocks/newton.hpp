// Semismooth Newton method on the natural map of the exact laws of contact and friction.
//
// With y = f - rho w and the projection P of each element (for a contact, P_n = max(0, y_n) and P_T the projection of
// y_T on the disk of radius mu P_n), the laws hold exactly if
//     e(f) = P(f - rho w) - f = 0.
// A step has a proximal term d (f - f_now) / rho. With this term the iteration has the same solutions, and the equations of
// a step are regular for any redundancy of the rows. With A = dP/dy, S = I - (1 - d) A, z = S^-1 e and G = S^-1 A
// diag(rho):
//     (M + J^T G J) dx = J^T z,   df = z - G J dx.
// rho is the inverse of an element's own response. (P. Alart, A. Curnier, "A mixed formulation for frictional contact
// problems prone to Newton like solution methods", Comput. Methods Appl. Mech. Engrg. 92, 1991.)
#pragma once

#include "complementarity/blocks/factor.hpp"

namespace pn {

// Errors are relative to an element's forces, as `solve` returns them.
struct BlockNewtonParameters {
    double tolerance = 1e-12;       // error at which the iteration ends
    double stall_tolerance = 1e-9;  // error near the solution: steps without progress end, and rounding is removed
    double stall_ratio = 0.25;      // ratio of two errors that counts as no progress near the solution
    int max_steps = 40;             // maximum number of steps
    double decrease = 0.01;         // required fraction of the predicted decrease of the squared error
    int max_refusals = 4;           // refused steps in a row, each with a larger proximal term
    int max_halvings = 2, max_patient_halvings = 6;  // halvings of a step of a bold and of a patient search
    int max_unguarded_steps = 3;    // full steps without decrease
    double min_proximal = 1e-8;     // minimum weight d of the proximal term: the root of the unit roundoff
    double max_proximal = 0.1;      // largest weight of the proximal term
    double proximal_growth = 5.0;   // growth of the weight after a refused step
    // Reduction of the weight after a full step, and after one whose ratio of squared errors is at most `good_decrease`.
    double reduction = 0.3, good_reduction = 0.01, good_decrease = 0.1;
    double error_part = 1e-3;  // minimum weight after a full step, relative to the error
    // Ratio of two squared errors after which `solve_without_compliance` keeps its factor.
    double fast_decrease = 1e-4;
    // Least and largest change of the weight that keeps the factor.
    double min_kept_ratio = 0.3, max_kept_ratio = 3.0;
};

class BlockNewton {
public:
    using Parameters = BlockNewtonParameters;
    static constexpr Parameters parameters{};

    // Set up the stiffness rho of all elements.
    void pose(const BlockProblem& p);
    // bold: least proximal term first, which few refused steps enlarge, then full steps. This search is fast from a good
    // guess. patient: a proximal term as large as the error, and steps that may increase the error for a while.
    enum class Search { bold, patient };

    // Begin an island: errors of elements without force are relative to its largest free velocity, w under no forces.
    void begin(const BlockProblem& p, const Island& island, const VecX& free_w);
    // Solve the laws of an island from the forces f with their motion x, w = J x + offset. Return the error of the best
    // forces found, and store these forces and their motion. Each element has a compliance of `compliance` times its own
    // response. `factor` keeps the order of elimination of the island.
    double solve(const BlockProblem& p, const Island& island, BlockFactor& factor, Search search, double compliance,
                 VecX& f, VecX& x, VecX& w);
    // Solve the laws without compliance, from the forces and the factor of a solution with small compliance.
    double solve_without_compliance(const BlockProblem& p, const Island& island, BlockFactor& factor, VecX& f, VecX& x,
                                    VecX& w);
    // Return the error of the forces f with the rows w of their motion.
    double error(const BlockProblem& p, const Island& island, const VecX& f, const VecX& w);
    // Improve f by sweeps of the projected Gauss-Seidel method: each element in turn solves its own laws, with the forces
    // of the others fixed. Compute the motion x, w of f.
    void sweep(const BlockProblem& p, const Island& island, int sweeps, VecX& f, VecX& x, VecX& w);
    // Compute x and w of the island under the forces f.
    void move(const BlockProblem& p, const Island& island, const VecX& f, VecX& x, VecX& w) const;
    // Return the largest of the rows w of an island, or of its elements that rest (`of_rest`), relative to the largest
    // row without forces, in units of the root of an energy.
    double speed(const BlockProblem& p, const Island& island, const VecX& w, bool of_rest) const;
    // Find the element of an island with the largest relative error, and that error as a velocity.
    void worst(const BlockProblem& p, const Island& island, const VecX& f, const VecX& w, int& element,
               double& velocity) const;
    // Project forces onto their cones. Return true if this changes them.
    bool project(const BlockProblem& p, const Island& island, VecX& f) const;

    double unit() const { return unit_; }  // largest free velocity of the island, in units of the root of an energy
    double stiffness(int row) const { return rho_[row]; }
    const std::vector<double>& stiffnesses() const { return rho_; }
    int steps() const { return steps_; }      // steps since construction
    int factors() const { return factors_; }  // factorizations since construction

private:
    enum class Piece : signed char { open, sticks, slips, unknown };

    // Projection of one element: direction and length of y_T, and radius of the disk.
    struct Projection {
        Piece piece = Piece::open;
        double P[3] = {0.0, 0.0, 0.0};
        double t[3] = {0.0, 0.0, 0.0};
        double ratio = 0.0;  // radius divided by length
    };

    Projection projection(const BlockElement& e, const double* y) const;
    double evaluate(const BlockProblem& p, const Island& island, const VecX& f, const VecX& w, double& merit);
    bool has_changed_piece(const Island& island) const;
    bool linearize(const BlockProblem& p, const Island& island, double d, bool anew, bool& symmetric);
    void local_step(const BlockProblem& p, const Island& island, double d, VecX& dx);
    void find_step(const BlockProblem& p, const Island& island, const BlockFactor& factor, double d);
    void try_step(const BlockProblem& p, const Island& island, const VecX& f);
    bool shorten(const BlockProblem& p, const Island& island, const VecX& f, const VecX& w, double bound,
                 int most_halvings, double& length, double& error, double& merit);
    void take(const BlockProblem& p, const Island& island, double length, VecX& f, VecX& x, VecX& w);

    std::vector<double> rho_, root_rho_, G_;
    std::vector<int> listed_;      // all elements
    std::vector<Mat3> responses_;  // per element
    std::vector<double> unit_force_;  // inverse of root_rho_: forces in units of the root of an energy
    std::vector<Piece> piece_;
    std::vector<Projection> there_;  // at the last evaluation
    VecX y_, e_, z_, df_, dx_, dw_, f_best_;
    VecX f_full_, x_full_, w_full_;  // forces and motion of the full step
    VecX f_part_, w_part_;           // forces and motion of a shorter step
    double compliance_ = 0.0;
    double yielding_ = 0.0;      // compliance and proximal weight of the last factor, 0 if the last solution needed none
    bool keeps_factor_ = false;  // the next step uses the last factor
    double unit_ = 0.0;  // largest free velocity of the island, in units of the square root of an energy
    int steps_ = 0, factors_ = 0;
};

}  // namespace pn
