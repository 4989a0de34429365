// What the files of Python's door share: arrays in and out, the scene that is being built, the runner that moves it.
// Everything a user can pass wrong has been checked in Python before it comes here.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include "run/simulation.hpp"

namespace pn {

namespace nb = nanobind;

using Array = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Array2 = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

inline Eigen::Map<const VecX> map(const Array& a) { return {a.data(), static_cast<Eigen::Index>(a.shape(0))}; }
inline Eigen::Map<const RowMajor> map(const Array2& a) {
    return {a.data(), static_cast<Eigen::Index>(a.shape(0)), static_cast<Eigen::Index>(a.shape(1))};
}

// Arrays that Python gets.
using Numbers = nb::ndarray<nb::numpy, double, nb::ndim<1>>;
using Table = nb::ndarray<nb::numpy, double, nb::ndim<2>>;

inline Numbers to_numpy(std::vector<double>&& x) {  // its numbers stay where they are
    auto* kept = new std::vector<double>(std::move(x));
    kept->reserve(1);  // an array has an address, one without numbers too
    nb::capsule owner(kept, [](void* v) noexcept { delete static_cast<std::vector<double>*>(v); });
    return Numbers(kept->data(), {kept->size()}, owner);
}
inline Numbers to_numpy(const double* data, size_t n) { return to_numpy(std::vector<double>(data, data + n)); }
inline Numbers to_numpy(const VecX& x) { return to_numpy(x.data(), x.size()); }

inline void read_into(const nb::object& from, VecX& to) {
    const Array a = nb::cast<Array>(from);
    to = map(a);
}

using FrameTuple = std::tuple<int, std::vector<double>, std::vector<double>>;  // joint, R by rows, p

inline Vec3 vec3(const std::vector<double>& x) { return Vec3(x[0], x[1], x[2]); }

inline Frame frame_of(const FrameTuple& f) {
    return {std::get<0>(f), Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(std::get<1>(f).data()),
            vec3(std::get<2>(f))};
}

// A function of Python, or None.
template <class Signature>
using Function = std::optional<nb::typed<nb::callable, Signature>>;

// A scene on its way into the core: Python adds constraints, laws and forces, and finishes the program.
struct Builder {
    std::shared_ptr<Program> p = std::make_shared<Program>();

    Builder(nb::object model, Provider terms);
    // Return the index of the new block or law. Directions of friction follow all constraints.
    int add(const std::string& name, Kind kind, Role role);
    int add_law(const std::string& name);
    // A program of its own, which nothing that is added later changes.
    std::shared_ptr<const Program> finish() const;
};

// What Python may ask of the rows of a constraint or contact.
struct ConstraintRows {
    std::string name;
    int first, count;             // among the rows of all descriptions
    std::vector<bool> holonomic;  // each of them: a position stands behind it
    bool moves_in_time;           // by itself, or a function of the user says how
    Shown shown;                  // what a replay shows of it
};
std::vector<ConstraintRows> constraint_rows(const Program& p);

// Eq. (40) at one state, with what its friction does.
struct Instant {
    Numbers a, F_ideal, F_nonideal, C, F, lam, lam_ideal;
    int rank;
    std::vector<Mode> modes;
    std::vector<Numbers> friction;  // force of each element along its directions
    std::vector<double> limits;
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
    VecX q, v;

    explicit Runner(std::shared_ptr<const Program> program);

    // Writes the acceleration into `out`, an array of nv numbers; plain buffers, since this is called in tight loops.
    void acceleration(nb::handle q_in, nb::handle v_in, double t, nb::handle tau, nb::handle out);
    Instant solve(const Array& q_in, const Array& v_in, double t, const std::optional<Array>& tau,
                  const std::optional<std::vector<Mode>>& modes);
    int constraint_rank() const;
    // All rows of all constraints, dropped ones too: A (by rows), b, residual, rate.
    std::tuple<Numbers, Numbers, Numbers, Numbers> rows(const Array& q_in, const Array& v_in, double t);
    // M (dense, by rows) and the bias forces.
    std::pair<Numbers, Numbers> terms(const Array& q_in, const Array& v_in);
    // q and v on the constraints, and the largest residual before (beyond `far` nothing moves), residual and rate
    // after.
    std::tuple<Numbers, Numbers, double, double, double> project(const Array& q_in, const Array& v_in, double t,
                                                                 double far);
    double time_evaluations(const Array& q_in, const Array& v_in, double t, int count);

    // For integrators outside the core: the rate of y = (q, v, states of laws, work of the ledger's columns).
    Numbers derivative(double t, const Array& y_in, bool energy);
    // Such a y put on the constraints, and the energy that this moved.
    std::pair<Numbers, double> project_outside(double t, const Array& y_in, bool with_energy);
    // Samples of such a run as the core records its own; `moved` is the energy moved by projection up to each.
    Outcome record(const Array& times, const Array2& states, const Array& moved, const RecordOptions& options,
                   long steps);

    Outcome simulate(const Array& q_in, const Array& v_in, const Options& options);
    Outcome resume(const nb::bytes& state, const Options& options);

private:
    // What does not fit is refused here and explained in Python.
    void set(const Array& q_in, const Array& v_in, const std::optional<Array>& tau);
    // Modes by velocity, and at rest by the complementarity problem; or the ones given.
    void choose_modes(double t, const std::optional<std::vector<Mode>>& modes);
    // Such a y with the core's watch of sticking elements behind it.
    VecX read_state(const System& system, const VecX& outside);
    double energy();
};

// What Python sees of a failure: an exception with its kind, time, elements and value.
nb::object failure_object(const Failure& failure);

void bind_failures(nb::module_& m);
void bind_reactions(nb::module_& m);
void bind_builder(nb::module_& m);
void bind_constraints(nb::class_<Builder>& builder);
void bind_runner(nb::module_& m);
void bind_runs(nb::module_& m, nb::class_<Runner>& runner);

}  // namespace pn
