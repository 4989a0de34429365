// Forces of the contacts and the dry friction in one step of time stepping: the cone problem of its elements.
//
// If there are no constraints but prescribed motions, and no limit of dry friction follows a load, the trees are solved one
// by one. If this fails, and in other scenes, the responses of all rows are used.
#pragma once

#include "complementarity/box_lcp.hpp"
#include "complementarity/cone/solver.hpp"
#include "run/time_stepping/separate_trees.hpp"
#include "run/time_stepping/shared_friction.hpp"
#include "run/time_stepping/step_elements.hpp"
#include "run/time_stepping/step_responses.hpp"

namespace pn {

struct StepForcesParameters {
    // Largest relative error of the forces of separate trees with which the search with all responses is brief.
    double max_brief_error = 1e-2;
    // Largest number of rows of separate trees that are solved with all responses if the search tree by tree fails. The
    // cost grows with the cube of the number, to a tenth of a second here.
    int max_rows_with_responses = 200;
    // Largest number of joints with dry friction, in a scene without contacts and constraints, that take less time with
    // all responses than tree by tree.
    int max_boxes_with_responses = 32;
    // Largest turn of a direction in a step whose change of a rate is taken into account [half rad].
    double max_turn = 0.25;
    // Distance of a force at its limit, relative to the largest force.
    double limit_rounding = 1e-9;
    // Rows at the step's end that count as rest, relative to the rows without the forces.
    double rest_rounding = 1e-9;
    // Rounding error of the rows without forces, relative to the largest acceleration. Smaller rows show no residual.
    double row_rounding = 1e-12;
    // Accepted residual relative to the velocities, and accepted error of a limit relative to the forces. A step of a
    // turning body can have no exact solution if corners share its load. The statistics report both.
    double max_residual = 1e-7;
};

class StepForces {
public:
    using Parameters = StepForcesParameters;
    static constexpr Parameters parameters{};

    VecX f;         // force of each row: its impulse divided by the step's length
    VecX end_rows;  // rows at the step's end under the forces, divided by the step's length

    StepForces(const Program& p, Workspace& w, const StepElements& elements);

    // Discard the configuration that no forces held at rest in earlier steps.
    void reset() { w.state.q_without_rest.resize(0); }
    // Set up the problem of the elements for the acceleration `a_free` without the forces, over a step of length h. The
    // forces of the last step are the guess. `anew`: the rows have changed.
    void pose(const MeanVelocity& mean, double h, const VecX& a_free, bool anew);
    // Solve the laws tree by tree if possible, else with the responses of all rows. The step starts at (q0, v0).
    bool solve(double h, const VecX& q0, const VecX& v0);
    // Check if some forces of dry friction outside of cones do not move the bodies.
    bool are_dependent() const { return are_dependent_; }
    // Replace sticking forces of this friction by the forces of least norm with the same motion.
    void share_loads(double h, const VecX& v0);
    // Remove slip of this friction that constraints prevent, except for elements that prescribed motions move.
    void drop_prevented_slip();
    // Compute the rows at the step's end under the forces.
    void measure_end();
    // Response of a row to its own force under the constraints, if these join the trees.
    double response(int row) const { return responses_.diagonal(row); }
    // Error of the rows at, ..., at + dim - 1 of an element at the step's end, if the forces satisfy the laws.
    double row_error(int at, int dim) const;
    // Return the rate of rows at the step's end that counts as rest, divided by the step's length.
    double rest_of_rows() const;
    // Errors of the laws for the forces.
    ConeResiduals residuals();

    // Add the acceleration due to the forces, and the multipliers of the constraints, to the motion without these
    // forces.
    void add_motion(VecX& a);
    void add_multipliers(VecX& lam);
    // Set the velocity v1 of trees that rest over the step to zero.
    void stop_resting_trees(double h, const VecX& v0, VecX& v1) {
        if (separate_) trees_.keep_rest(h, v0, v1);
    }
    // Check if the trees are solved one by one.
    bool is_separate() const { return separate_; }

    // Contact whose laws the last step violated, as a block or -1, and the violation as a velocity [m/s].
    struct LawMiss {
        int block = -1;
        double miss = 0.0;
    };
    const LawMiss& law_miss() const { return law_miss_; }
    // Return the blocks of contacts that the motion closes whatever the forces, after a search that found no forces.
    std::vector<int> contradicting_contacts() const;
    void clear_miss() { law_miss_ = {}; }

private:
    void measure_free(const MeanVelocity& mean, double h, const VecX& a_free);
    double turning_rate(const StepRow& row, double h) const;
    void recall_forces();
    void unload_held(const MeanVelocity& mean, const VecX& a_free);
    void find_dependent();
    bool accept_best_forces(double h);
    bool solve_with_responses(bool starts, const VecX& q0);
    bool has_boxes_only() const;
    bool has_few_boxes() const;
    bool solve_boxes();
    bool solve_cones(bool starts, const VecX& q0);
    void hold_resting(const VecX& q0);
    bool keep_rest(bool solved, const VecX& q0);

    const Program& p;
    Workspace& w;
    const StepElements& elements_;
    SeparateTrees trees_;
    bool separate_ = false;
    double error_ = 0.0;     // error of the last solution, relative to the rows without forces
    ConeStatus status_ = ConeStatus::solved;  // of the last search for cones with all responses
    bool has_load_ = false;  // the rows without forces are more than rounding
    StepResponses responses_;
    SharedFriction shared_;
    bool are_dependent_ = false;
    std::vector<SharedFriction::Element> sticking_;
    std::vector<char> rests_;  // per element
    std::vector<int> dry_rows_;
    ConeComplementarity solver_;
    BoxProgram box_;
    LawMiss law_miss_;
    VecX free_rows_, offset_, middle_, guess_, best_f_, a_;
    VecX centered_;           // forces minus the middles of their limits
    VecX box_rows_, bounds_;  // rows without forces and limits of a problem of boxes
};

}  // namespace pn
