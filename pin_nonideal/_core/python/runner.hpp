// Evaluations of single states, and consecutive runs.
#pragma once

#include <memory>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include "contact/onset.hpp"
#include "dynamics/law_residuals.hpp"
#include "python/arrays.hpp"
#include "python/outcome.hpp"
#include "python/reused_run.hpp"

namespace pn {

// Solution of Eq. (40) at one state, with its friction.
struct Instant {
    Numbers a, F_ideal, F_nonideal, C, F, lam, lam_ideal;
    int rank;
    std::vector<Mode> modes;
    std::vector<std::int8_t> closed;  // per contact
    std::vector<Numbers> friction;  // force of each element along its directions
    std::vector<double> limits;
    std::optional<bool> unique;  // no value: not proven
};

// Program with one workspace, for evaluations of states and for runs.
struct Runner {
    std::shared_ptr<const Program> p;
    std::unique_ptr<Workspace> w;
    RunState first;  // run state of a new workspace
    VecX q, v;

    // RunOptions of the last run in Python, and their conversion. Functions belong to one run only.
    nb::object last_options;
    Options options;

    explicit Runner(std::shared_ptr<const Program> program);

    // Return the converted options of a run. The options are converted again only if the object differs from the object
    // of the last run.
    Options& read(const nb::object& run_options);

    // Write the acceleration into `out`, an array of nv numbers. Uses plain buffers, for calls in tight loops.
    void acceleration(nb::handle q_in, nb::handle v_in, double t, nb::handle tau, nb::handle out);
    // Solve Eq. (40) at one state. `frozen`: functions of time are constant, for states of rest. `directions`: unit slip
    // directions in the order of `slip_rows`, for given modes of elements that begin to slip.
    Instant solve(const Array& q_in, const Array& v_in, double t, const std::optional<Array>& tau,
                  const std::optional<std::vector<Mode>>& modes, bool frozen, const std::optional<Array>& directions);
    int constraint_rank() const;
    // Return the rows of some blocks, including removed rows: A (row-major), b, residual, rate. Without a choice, return the
    // rows of all constraints and contacts in the order of their descriptions.
    std::tuple<Numbers, Numbers, Numbers, Numbers> rows(const Array& q_in, const Array& v_in, double t,
                                                        const std::optional<std::vector<int>>& chosen);
    // Return the residuals of all these rows.
    Numbers residuals(const Array& q_in, const Array& v_in, double t);
    // Return the greatest length that each row of `rows` can have at q, and without a choice of blocks also that of each
    // direction of the friction elements. `own`: return the actual lengths. Lengths use the metric of M^-1.
    Numbers row_lengths(const Array& q_in, const Array& v_in, double t, bool own,
                        const std::optional<std::vector<int>>& chosen);
    // Return the slip directions of all friction elements as rows, whose rates are slip velocities.
    Numbers slip_rows(const Array& q_in, const Array& v_in, double t);
    // Return M (dense, row-major) and the bias forces.
    std::pair<Numbers, Numbers> terms(const Array& q_in, const Array& v_in);
    // Return the kinetic energy, and the potential energy in gravity [J].
    std::pair<double, double> energies(const Array& q_in, const Array& v_in);
    // Project q and v onto the constraints. Return q, v, the largest residual before, and the residual and rate after.
    // If the residual before exceeds `max_residual`, nothing moves.
    std::tuple<Numbers, Numbers, double, double, double> project(const Array& q_in, const Array& v_in, double t,
                                                                 double max_residual);
    // Return the largest residual of each law and the index of its dof, block or friction element, in the order of
    // LawResiduals. The accelerations, contact loads and friction forces replace those of the motion if given.
    std::vector<std::pair<double, int>> law_residuals(const Array& q_in, const Array& v_in, double t,
                                                      const std::optional<Array>& tau,
                                                      const std::optional<std::vector<Mode>>& modes,
                                                      const std::optional<Array>& a, const std::optional<Array>& loads,
                                                      const std::optional<std::vector<Array>>& friction);
    double time_evaluations(const Array& q_in, const Array& v_in, double t, int count);

    // Simulate with the options read last.
    Outcome simulate(const Array& q_in, const Array& v_in);
    Outcome resume(const nb::bytes& state, const Options& with);

private:
    ReusedRun run_;  // kept run, which records only states
    MotionState state_;  // state of the motion with the last selected modes
    bool is_choice_unique_ = true;  // the last modes are the only ones with a motion
    std::vector<Vec3> directions_;  // given slip directions of the elements

    // Set the state and the torques. Throw std::invalid_argument if they do not fit the model, which Python explains.
    void set(const Array& q_in, const Array& v_in, const std::optional<Array>& tau);
    // Return the chosen blocks, or all blocks of constraints and contacts in the order of their rows.
    std::vector<int> chosen_blocks(const std::optional<std::vector<int>>& blocks) const;
    void read_directions(const Array& directions);
    // Set the modes: the given ones, else by velocity, and at rest by the complementarity problem.
    void choose_modes(double t, const std::optional<std::vector<Mode>>& modes);
    void choose_contacts(double t, const std::optional<std::vector<Mode>>& modes);
    void choose_friction(double t, const std::optional<std::vector<Mode>>& modes, const OnsetMotion* joint_motion);
};

nb::class_<Runner> bind_runner(nb::module_& m);

}  // namespace pn
