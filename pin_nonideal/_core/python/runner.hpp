// Evaluations of single states, and one run after another.
#pragma once

#include <memory>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include "contact/onset.hpp"
#include "python/arrays.hpp"
#include "python/reused_run.hpp"

namespace pn {

// Eq. (40) at one state, with what its friction does.
struct Instant {
    Numbers a, F_ideal, F_nonideal, C, F, lam, lam_ideal;
    int rank;
    std::vector<Mode> modes;
    std::vector<std::int8_t> closed;  // of each contact
    std::vector<Numbers> friction;  // force of each element along its directions
    std::vector<double> limits;
    std::optional<bool> unique;  // nothing: not shown
};

// A run that has ended.
struct Outcome {
    Counters counters;
    Recording recording;
};

// One workspace and the program it belongs to: evaluates states, and carries runs.
struct Runner {
    std::shared_ptr<const Program> p;
    std::unique_ptr<Workspace> w;
    RunState first;  // of a new workspace
    VecX q, v;

    // What the last run was asked for, a RunOptions of Python, and as the core reads it; functions are those of one run.
    nb::object asked;
    Options options;

    explicit Runner(std::shared_ptr<const Program> program);

    // The options of a run, which are read where they are not those of the last.
    Options& read(const nb::object& run_options);

    // Writes the acceleration into `out`, an array of nv numbers; plain buffers, since this is called in tight loops.
    void acceleration(nb::handle q_in, nb::handle v_in, double t, nb::handle tau, nb::handle out);
    // Frozen: at a state of rest, as if functions of time stood still there.
    Instant solve(const Array& q_in, const Array& v_in, double t, const std::optional<Array>& tau,
                  const std::optional<std::vector<Mode>>& modes, bool frozen);
    int constraint_rank() const;
    // All rows of all constraints, dropped ones too: A (by rows), b, residual, rate.
    std::tuple<Numbers, Numbers, Numbers, Numbers> rows(const Array& q_in, const Array& v_in, double t);
    // The greatest length that each of these rows could have at q, then each direction of the frictional elements.
    Numbers row_lengths(const Array& q_in, const Array& v_in, double t, bool own);
    // Directions along which frictional elements slip: rows of all, whose rates are slip velocities.
    Numbers slip_rows(const Array& q_in, const Array& v_in, double t);
    // Of each contact between two frames a point of the line along which it presses, and the normal that its row pushes
    // the body of frame 1 along, in world axes: six numbers each.
    Numbers pressing_lines(const Array& q_in, const Array& v_in, double t);
    // M (dense, by rows) and the bias forces.
    std::pair<Numbers, Numbers> terms(const Array& q_in, const Array& v_in);
    // Kinetic energy, and potential energy in gravity [J].
    std::pair<double, double> energies(const Array& q_in, const Array& v_in);
    // q and v on the constraints, and the largest residual before (beyond `far` nothing moves), residual and rate
    // after.
    std::tuple<Numbers, Numbers, double, double, double> project(const Array& q_in, const Array& v_in, double t,
                                                                 double far);
    double time_evaluations(const Array& q_in, const Array& v_in, double t, int count);

    // With the options read last.
    Outcome simulate(const Array& q_in, const Array& v_in);
    Outcome resume(const nb::bytes& state, const Options& with);

private:
    KeptRun run_;  // of fixed steps, which records states

    // What does not fit is refused here and explained in Python.
    void set(const Array& q_in, const Array& v_in, const std::optional<Array>& tau);
    // All rows of all constraints and contacts, at one state.
    void place_rows(const Array& q_in, const Array& v_in, double t);
    // Modes by velocity, and at rest by the complementarity problem; or the ones given.
    void choose_modes(double t, const std::optional<std::vector<Mode>>& modes);
    void choose_contacts(double t, const std::optional<std::vector<Mode>>& modes);
    void choose_friction(double t, const std::optional<std::vector<Mode>>& modes, const RestingMotion* together);
};

nb::class_<Runner> bind_runner(nb::module_& m);

}  // namespace pn
