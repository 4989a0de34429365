// What the files of Python's door share: arrays in and out, the scene that is being built, the runner that moves it.
// Everything a user can pass wrong has been checked in Python before it comes here.
#pragma once

#include <memory>
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

inline nb::object to_numpy(const double* data, size_t n) {
    double* copy = new double[n > 0 ? n : 1];
    std::copy(data, data + n, copy);
    nb::capsule owner(copy, [](void* x) noexcept { delete[] static_cast<double*>(x); });
    return nb::cast(nb::ndarray<nb::numpy, double, nb::ndim<1>>(copy, {n}, owner));
}
inline nb::object to_numpy(const VecX& x) { return to_numpy(x.data(), x.size()); }
inline nb::object to_numpy(std::vector<double>&& x) {  // its numbers stay where they are
    auto* kept = new std::vector<double>(std::move(x));
    kept->reserve(1);  // an array has an address, one without numbers too
    nb::capsule owner(kept, [](void* v) noexcept { delete static_cast<std::vector<double>*>(v); });
    return nb::cast(nb::ndarray<nb::numpy, double, nb::ndim<1>>(kept->data(), {kept->size()}, owner));
}

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

// A scene on its way into the core: Python adds constraints, laws and forces, and finishes the program.
struct Builder {
    std::shared_ptr<Program> p = std::make_shared<Program>();

    // M and the bias forces by Pinocchio's algorithms, or by the core's own pass.
    Builder(nb::object model, bool pinocchio_terms);
    // Return the index of the new block or law.
    int add(const std::string& name, Kind kind, bool constraint, int user_size = 0);
    int add_law(const std::string& name);
};

// One workspace and the program it belongs to: evaluates states, and carries runs.
struct Runner {
    std::shared_ptr<const Program> p;
    std::unique_ptr<Workspace> w;
    VecX q, v;

    explicit Runner(std::shared_ptr<const Program> program);

    // Writes the acceleration into `out`, an array of nv numbers; plain buffers, since this is called in tight loops.
    void acceleration(nb::handle q_in, nb::handle v_in, double t, nb::handle tau, nb::handle out);
    nb::dict solve(const Array& q_in, const Array& v_in, double t, nb::object tau, nb::object modes);
    int constraint_rank() const;
    // All rows of all constraints, dropped ones too: A, b, residual, rate.
    nb::tuple rows(const Array& q_in, const Array& v_in, double t);
    // M (dense, by rows) and the bias forces.
    nb::tuple terms(const Array& q_in, const Array& v_in);
    // q and v on the constraints, and the largest residual before (beyond `far` nothing moves), residual and rate
    // after.
    nb::tuple project_state(const Array& q_in, const Array& v_in, double t, double far);
    double time_evaluations(const Array& q_in, const Array& v_in, double t, int count);

    // For integrators outside the core: the rate of y = (q, v, states of laws, work of the ledger's columns).
    nb::object derivative(double t, const Array& y_in, bool energy);
    // Such a y put on the constraints, and the energy that this moved.
    nb::tuple settle(double t, const Array& y_in, bool with_energy);
    // Samples of such a run as the core records its own; `moved` is the energy moved by projection up to each.
    nb::dict record(const Array& times, const Array2& states, const Array& moved, const nb::dict& options);

    nb::dict simulate(const Array& q_in, const Array& v_in, const Array& z, const nb::dict& options);
    nb::dict resume(const nb::bytes& state, const nb::dict& options);

private:
    // What does not fit is refused here and explained in Python.
    void set(const Array& q_in, const Array& v_in, const nb::object& tau);
    // Modes by velocity, and at rest by the complementarity problem; or the ones given.
    void choose_modes(double t, const nb::object& modes);
    // Such a y with the core's watch of sticking elements behind it.
    VecX read_state(const System& system, const VecX& outside);
    double energy();
};

// q and v of many states on the constraints, by rows, and the largest residual and rate of each afterwards: NaN where
// the state could not be taken. On several threads, each state as by Runner::project_state.
nb::tuple nearest_states(const Builder& b, const Array2& q, const Array2& v, double t, double far, int threads);
// A run that has ended. A batch hands its runs over one at a time, while their numbers are still near.
struct Outcome {
    Counters counters;
    Recording recording;
    // To Python, once; fields without a number are left out.
    nb::dict hand_over();
};

// Outcomes of runs from many states, on several threads. Where one is interrupted all stop, and the others are None.
nb::list rollout(const Builder& b, const Array2& q, const Array2& v, const Array& z, const nb::dict& options,
                 int threads);

RecordOptions read_record(const nb::dict& options);

// What Python sees of a failure: an exception with its kind, time, elements and value.
nb::object failure_object(const Failure& failure);

void bind_failures(nb::module_& m);
void bind_reactions(nb::module_& m);
void bind_builder(nb::module_& m);
void bind_constraints(nb::class_<Builder>& builder);
void bind_slip_directions(nb::class_<Builder>& builder);
void bind_runner(nb::module_& m);

}  // namespace pn
