// Evaluations of single states, and what an integrator outside the core asks for.
#include "python/bindings.hpp"

#include <chrono>

#include <nanobind/stl/vector.h>

#include "constraints/projection.hpp"
#include "dynamics/evaluation.hpp"
#include "dynamics/step_start.hpp"
#include "friction/modes.hpp"
#include "tree/liegroup.hpp"

using namespace nanobind::literals;

namespace pn {

namespace {

constexpr double unit_tolerance = 1e-6;  // of quaternions and (cos, sin) pairs, as at Python's door

// A contiguous buffer of doubles, without the detour over an array object.
class Buffer {
public:
    Buffer(nb::handle object, int flags) {
        if (PyObject_GetBuffer(object.ptr(), &view_, PyBUF_C_CONTIGUOUS | PyBUF_FORMAT | flags) != 0) {
            PyErr_Clear();
            throw std::invalid_argument("expected a contiguous array of floats");
        }
    }
    ~Buffer() { PyBuffer_Release(&view_); }
    Buffer(const Buffer&) = delete;
    Buffer& operator=(const Buffer&) = delete;
    void check(Eigen::Index n) const {
        if (view_.ndim != 1 || view_.shape[0] != n || view_.format == nullptr || view_.format[0] != 'd')
            throw std::invalid_argument("expected an array of floats of the model's size");
    }
    double* data() const { return static_cast<double*>(view_.buf); }

private:
    Py_buffer view_;
};

void read_buffer(nb::handle from, VecX& to) {
    const Buffer buffer(from, 0);
    buffer.check(to.size());
    to = Eigen::Map<const VecX>(buffer.data(), to.size());
    if (!to.allFinite()) throw std::invalid_argument("expected finite numbers");
}

}  // namespace

Runner::Runner(std::shared_ptr<const Program> program)
    : p(std::move(program)), w(std::make_unique<Workspace>(*p)), q(p->mechanism.nq), v(p->mechanism.nv) {}

void Runner::set(const Array& q_in, const Array& v_in, const nb::object& tau) {
    const Mechanism& m = p->mechanism;
    const auto holds = [](const Array& x, int n) { return x.shape(0) == static_cast<size_t>(n); };
    if (!holds(q_in, m.nq) || !holds(v_in, m.nv) || !has_unit_lengths(m, q_in.data(), unit_tolerance))
        throw std::invalid_argument("q or v does not fit the model");
    q = map(q_in);
    v = map(v_in);
    w->now.has_override = !tau.is_none();
    if (!w->now.has_override) return;
    const Array torque = nb::cast<Array>(tau);
    if (!holds(torque, m.nv)) throw std::invalid_argument("tau does not fit the model");
    w->now.override_torque = map(torque);
}

void Runner::choose_modes(double t, const nb::object& modes) {
    if (modes.is_none()) return resolve_modes(*p, *w, t, q, v, first_question(*p, *w, t, q, v));
    const auto given = nb::cast<std::vector<int>>(modes);
    set_modes(*p, *w, std::vector<signed char>(given.begin(), given.end()));
    w->state.warm = false;
    begin_step(*p, *w, t, q, v);
}

void Runner::acceleration(nb::handle q_in, nb::handle v_in, double t, nb::handle tau, nb::handle out) {
    read_buffer(q_in, q);
    if (!has_unit_lengths(p->mechanism, q.data(), unit_tolerance))
        throw std::invalid_argument("q holds a part that is not of unit length");
    read_buffer(v_in, v);
    if (!std::isfinite(t)) throw std::invalid_argument("expected a finite time");
    w->now.has_override = !tau.is_none();
    if (w->now.has_override) read_buffer(tau, w->now.override_torque);
    if (p->frictions.empty()) begin_step(*p, *w, t, q, v);
    else choose_modes(t, nb::none());
    const Buffer target(out, PyBUF_WRITABLE);
    target.check(w->now.a.size());
    std::copy(w->now.a.data(), w->now.a.data() + w->now.a.size(), target.data());
}

nb::dict Runner::solve(const Array& q_in, const Array& v_in, double t, nb::object tau, nb::object modes) {
    set(q_in, v_in, tau);
    choose_modes(t, modes);
    nb::dict out;
    nb::list forces, limits, used;
    for (size_t e = 0; e < p->frictions.size(); ++e) {
        Vec3 f = friction_force(*p, *w, static_cast<int>(e));
        forces.append(to_numpy(&f[0], p->frictions[e].dim));
        limits.append(w->state.mode[e] == sticking ? static_limit(*p, *w, static_cast<int>(e), t, q, v) : w->now.limit[e]);
        used.append(static_cast<int>(w->state.mode[e]));
    }
    Split split;
    split_forces(*p, *w, split);
    out["a"] = to_numpy(w->now.a);
    out["F_ideal"] = to_numpy(split.F_ideal);
    out["F_nonideal"] = to_numpy(split.F_nonideal);
    out["C"] = to_numpy(split.C);
    out["F"] = to_numpy(w->now.F);
    out["lam"] = to_numpy(split.lam);
    out["lam_ideal"] = to_numpy(split.lam_ideal);
    out["rank"] = constraint_rank();
    out["modes"] = used;
    out["friction"] = forces;
    out["limits"] = limits;
    return out;
}

int Runner::constraint_rank() const {
    int rank = 0;
    for (int i = 0; i < p->constraints; ++i)
        for (size_t k = 0; k < p->blocks[i].kept.size(); ++k) rank += w->now.rows.active[p->blocks[i].row + k];
    return rank;
}

nb::tuple Runner::rows(const Array& q_in, const Array& v_in, double t) {
    set(q_in, v_in, nb::none());
    kinematics(p->mechanism, w->now.terms, q, v);
    evaluate_rows(*p, *w, t, v);
    const int nv = p->mechanism.nv;
    std::vector<double> A(static_cast<size_t>(p->user_rows) * nv, 0.0), b, phi, rate;
    for (int i = 0; i < p->constraints; ++i) {
        Block all = p->blocks[i];
        all.kept.clear();
        for (int k = 0; k < all.total; ++k) all.kept.push_back(k);
        const RowValues& values = w->now.values[i];
        std::vector<double> local(all.support.size() * all.total);
        fill_A(all, w->now.terms, values, local.data());
        for (int k = 0; k < all.total; ++k) {
            for (size_t l = 0; l < all.support.size(); ++l)
                A[static_cast<size_t>(all.user_row + k) * nv + all.support[l]] = local[l * all.total + k];
            b.push_back(-values.drift[k]);
            phi.push_back(values.residual[k]);
            rate.push_back(values.rate[k]);
        }
    }
    return nb::make_tuple(to_numpy(std::move(A)), to_numpy(std::move(b)), to_numpy(std::move(phi)),
                          to_numpy(std::move(rate)));
}

nb::tuple Runner::terms(const Array& q_in, const Array& v_in) {
    set(q_in, v_in, nb::none());
    kinematics(p->mechanism, w->now.terms, q, v);
    inertia(p->mechanism, w->now.terms);
    const Mechanism& m = p->mechanism;
    std::vector<double> M(static_cast<size_t>(m.nv) * m.nv, 0.0);
    for (int k = 0; k < m.nv; ++k)
        for (int i = k, s = 0; i >= 0; i = m.dof_parent[i], ++s)
            M[k * m.nv + i] = M[i * m.nv + k] = w->now.terms.M[m.row_offset[k] + s];
    return nb::make_tuple(to_numpy(std::move(M)), to_numpy(w->now.terms.nle));
}

nb::tuple Runner::project_state(const Array& q_in, const Array& v_in, double t, double far) {
    set(q_in, v_in, nb::none());
    const Closure found = close(*p, *w, t, q, v, far);
    return nb::make_tuple(to_numpy(q), to_numpy(v), found.before, found.after, found.rate);
}

nb::object Runner::derivative(double t, const Array& y_in, bool energy) {
    System system(*p, *w, energy);
    const VecX y = read_state(system, map(y_in));
    VecX rate(system.ny);
    choose_modes(t, nb::none());
    system.rate_of_evaluation(t, y, rate);
    return to_numpy(rate.data(), system.ny - system.ne);
}

nb::tuple Runner::settle(double t, const Array& y_in, bool with_energy) {
    System system(*p, *w, with_energy);
    VecX y = read_state(system, map(y_in));
    const double before = energy();
    project_anew(*p, *w, t, q, v);
    normalize(p->mechanism, q.data());
    y.head(system.nq) = q;
    y.segment(system.nq, system.nv) = v;
    return nb::make_tuple(to_numpy(y.data(), system.ny - system.ne), energy() - before);
}

nb::dict Runner::record(const Array& times, const Array2& states, const Array& moved, const nb::dict& options) {
    const RecordOptions wanted = read_record(options);
    System system(*p, *w, wanted.energy);
    Recording out;
    Recorder recorder(system, wanted, out);
    for (size_t k = 0; k < times.shape(0); ++k) {
        const double* row = states.data() + k * states.shape(1);
        const VecX y = read_state(system, Eigen::Map<const VecX>(row, states.shape(1)));
        choose_modes(times.data()[k], nb::none());
        recorder.sample(times.data()[k], y, moved.data()[k], true);
    }
    return Outcome{w->counters, std::move(out)}.hand_over();
}

VecX Runner::read_state(const System& system, const VecX& outside) {
    VecX y = VecX::Zero(system.ny);
    if (outside.size() != system.ny - system.ne) throw std::invalid_argument("y does not fit the scene");
    y.head(outside.size()) = outside;
    q = y.head(system.nq);
    v = system.velocity(y);
    if (system.nz > 0) w->state.z = y.segment(system.nq + system.nv, system.nz);
    w->now.has_override = false;
    return y;
}

double Runner::energy() {
    kinematics(p->mechanism, w->now.terms, q, v);
    inertia(p->mechanism, w->now.terms);
    return kinetic_energy(p->mechanism, w->now.terms, v) + potential_energy(p->mechanism, w->now.terms);
}

double Runner::time_evaluations(const Array& q_in, const Array& v_in, double t, int count) {
    set(q_in, v_in, nb::none());
    choose_modes(t, nb::none());
    const auto begin = std::chrono::steady_clock::now();
    for (int i = 0; i < count; ++i) evaluate(*p, *w, t, q, v);
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() / count;
}

void bind_runner(nb::module_& m) {
    nb::class_<Runner>(m, "Runner")
        .def("acceleration", &Runner::acceleration, "q"_a, "v"_a, "t"_a, "tau"_a.none(), "out"_a)
        .def("solve", &Runner::solve, "q"_a, "v"_a, "t"_a = 0.0, "tau"_a.none() = nb::none(),
             "modes"_a.none() = nb::none())
        .def("rows", &Runner::rows)
        .def("terms", &Runner::terms)
        .def("project", &Runner::project_state, "q"_a, "v"_a, "t"_a, "far"_a)
        .def("derivative", &Runner::derivative)
        .def("settle", &Runner::settle)
        .def("record", &Runner::record)
        .def("time_evaluations", &Runner::time_evaluations)
        .def_prop_ro("rank", &Runner::constraint_rank)
        // How the rows were factored last: smallest pivot, orthogonal road taken, redundant, refined.
        .def_prop_ro("factorization", [](Runner& r) {
            const RowSystem& s = r.w->now.rows;
            return nb::make_tuple(s.min_pivot, s.orthogonal, s.redundant, s.refine);
        })
        .def("simulate", &Runner::simulate)
        .def("resume", &Runner::resume);
}

}  // namespace pn
