// Python's door to the core: builds a Program from plain numbers, runs it, hands arrays back. Everything a user can
// pass wrong has been checked in Python before it comes here.
#include <atomic>
#include <chrono>
#include <memory>
#include <thread>

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/function.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "model_extraction.hpp"
#include "simulation.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace pn;

namespace {

using Array = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Array2 = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using FrameTuple = std::tuple<int, std::vector<double>, std::vector<double>>;  // joint, R by rows, p

Eigen::Map<const VecX> map(const Array& a) { return {a.data(), static_cast<Eigen::Index>(a.shape(0))}; }

nb::object to_numpy(const double* data, size_t n) {
    double* copy = new double[n > 0 ? n : 1];
    std::copy(data, data + n, copy);
    nb::capsule owner(copy, [](void* x) noexcept { delete[] static_cast<double*>(x); });
    return nb::cast(nb::ndarray<nb::numpy, double, nb::ndim<1>>(copy, {n}, owner));
}
nb::object to_numpy(const VecX& x) { return to_numpy(x.data(), x.size()); }
nb::object to_numpy(const std::vector<double>& x) { return to_numpy(x.data(), x.size()); }

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

void read_into(const nb::object& from, VecX& to) {
    const Array a = nb::cast<Array>(from);
    to = map(a);
}

Frame frame_of(const FrameTuple& f) {
    Frame out;
    out.joint = std::get<0>(f);
    out.R = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(std::get<1>(f).data());
    out.p = Eigen::Map<const Vec3>(std::get<2>(f).data());
    return out;
}

Vec3 vec3(const std::vector<double>& x) { return Vec3(x[0], x[1], x[2]); }

// ("polynomial", [c...]), ("sinusoid", [a, f, phase, offset]), ("spline", [breaks], [coefficients]) or a function.
TimeFunction time_function(const nb::object& f) {
    if (nb::isinstance<nb::tuple>(f)) {
        const nb::tuple parts = nb::cast<nb::tuple>(f);
        const std::string kind = nb::cast<std::string>(parts[0]);
        const auto numbers = nb::cast<std::vector<double>>(parts[1]);
        if (kind == "polynomial") return Polynomial{numbers};
        if (kind == "sinusoid") return Sinusoid{numbers[0], numbers[1], numbers[2], numbers[3]};
        return Spline{numbers, nb::cast<std::vector<double>>(parts[2])};
    }
    return std::function<Jet(double)>([f](double t) {
        nb::gil_scoped_acquire gil;
        const auto [x, dx, ddx] = nb::cast<std::tuple<double, double, double>>(f(t));
        return Jet{x, dx, ddx};
    });
}

// What a user's law may ask about the reactions while it runs.
struct ReactionView {
    const Program* p;
    Workspace* w;

    nb::object lam() const {
        VecX out = VecX::Zero(p->user_rows);
        for (int i = 0; i < p->constraints; ++i) {
            const Block& block = p->blocks[i];
            for (size_t k = 0; k < block.kept.size(); ++k)
                out[block.user_row + block.kept[k]] = w->lam_shared[block.row + k];
        }
        return to_numpy(out);
    }
    nb::object six(const Force& f, const Mat3& R) const {
        VecX out(6);
        out << R.transpose() * f.lin, R.transpose() * f.ang;
        return to_numpy(out);
    }
    nb::object of_joint(int joint) const { return six(joint_wrench(*p, *w, joint), w->terms.body[joint].R); }
    nb::object of_block(int block) const {
        const Frame& f = *frame2(p->blocks[block].kind);
        return six(anchor_wrench(*p, *w, block), w->terms.body[f.joint].R * f.R);
    }
};

struct Builder {
    std::shared_ptr<Program> p = std::make_shared<Program>();
    std::vector<nb::object> keep_alive;

    explicit Builder(nb::object model) { p->mechanism = read_mechanism(model_pointer(model.ptr())); }

    int add(const std::string& name, Kind kind, bool constraint, int user_size = 0) {
        Block block;
        block.name = name;
        block.total = row_count(kind, user_size);
        if (const Frame* f = frame1(kind)) block.joint1 = f->joint;
        if (const Frame* f = frame2(kind)) block.joint2 = f->joint;
        block.kind = std::move(kind);
        for (int k = 0; k < block.total; ++k) block.kept.push_back(k);
        if (constraint) {
            block.user_row = p->user_rows;
            p->user_rows += block.total;
            p->constraints = static_cast<int>(p->blocks.size()) + 1;
        }
        p->blocks.push_back(std::move(block));
        return static_cast<int>(p->blocks.size()) - 1;
    }
    int add_law(const std::string& name) {
        p->law_names.push_back(name);
        return static_cast<int>(p->law_names.size()) - 1;
    }
};

std::function<void(double, const VecX&, const VecX&, VecX&)> torque_function(nb::object f) {
    return [f](double t, const VecX& q, const VecX& v, VecX& out) {
        nb::gil_scoped_acquire gil;
        read_into(f(t, to_numpy(q), to_numpy(v)), out);
    };
}

VecX column(const Array& a) { return map(a); }

RecordOptions read_record(const nb::dict& d) {
    const auto wanted = [&](const char* key) { return nb::cast<bool>(d[key]); };
    return {wanted("a"), wanted("forces"), wanted("energy"), wanted("power")};
}

nb::dict hand_over(const Workspace& w, const Recording& r) {
    nb::dict out;
    const std::pair<const char*, const std::vector<double>*> fields[] = {
        {"t", &r.t}, {"q", &r.q}, {"v", &r.v}, {"violation", &r.violation}, {"violation_rate", &r.violation_rate},
        {"a", &r.a}, {"F_ideal", &r.F_ideal}, {"F_nonideal", &r.F_nonideal}, {"lam", &r.lam},
        {"lam_ideal", &r.lam_ideal}, {"energy", &r.energy}, {"power", &r.power}, {"z", &r.z}};
    for (const auto& [name, values] : fields) out[name] = to_numpy(*values);
    nb::list modes, events;
    std::vector<double> mode_numbers(r.modes.begin(), r.modes.end());
    out["modes"] = to_numpy(mode_numbers);
    for (const Event& e : r.events) events.append(nb::make_tuple(e.time, static_cast<int>(e.kind), e.element));
    out["events"] = events;
    out["steps"] = r.steps;
    out["rejected"] = r.rejected;
    out["evaluations"] = w.evaluations;
    out["factorizations"] = w.factorizations;
    out["projections"] = w.projections;
    out["iterations"] = w.iterations;
    out["failure"] = r.failure ? nb::cast(std::string(r.failure->what())) : nb::none();
    out["error"] = nb::none();
    if (r.error) {
        try {
            std::rethrow_exception(r.error);
        } catch (nb::python_error& e) {
            out["error"] = nb::borrow(e.value());
        } catch (const std::exception& e) {
            out["error"] = nb::cast(std::string(e.what()));
        }
    }
    return out;
}

constexpr double unit_tolerance = 1e-6;  // of quaternions and (cos, sin) pairs, as at Python's door

struct Runner {  // a workspace and the program it belongs to
    std::shared_ptr<const Program> p;
    std::unique_ptr<Workspace> w;
    VecX q, v;

    explicit Runner(std::shared_ptr<const Program> program)
        : p(std::move(program)), w(std::make_unique<Workspace>(*p)), q(p->mechanism.nq), v(p->mechanism.nv) {}

    // What does not fit is refused here and explained in Python.
    void set(const Array& q_in, const Array& v_in, const nb::object& tau) {
        const Mechanism& m = p->mechanism;
        const auto holds = [](const Array& x, int n) { return x.shape(0) == static_cast<size_t>(n); };
        if (!holds(q_in, m.nq) || !holds(v_in, m.nv) || !has_unit_lengths(m, q_in.data(), unit_tolerance))
            throw std::invalid_argument("q or v does not fit the model");
        q = map(q_in);
        v = map(v_in);
        w->has_override = !tau.is_none();
        if (!w->has_override) return;
        const Array torque = nb::cast<Array>(tau);
        if (!holds(torque, m.nv)) throw std::invalid_argument("tau does not fit the model");
        w->override_torque = map(torque);
    }

    // Modes by velocity, and at rest by the complementarity problem; or the ones given.
    void choose_modes(double t, const nb::object& modes) {
        const int n = static_cast<int>(p->frictions.size());
        if (!modes.is_none()) {
            const auto given = nb::cast<std::vector<int>>(modes);
            for (int e = 0; e < n; ++e) w->mode[e] = static_cast<signed char>(given[e]);
            w->warm = false;
            want_rows(*p, *w);
            begin_step(*p, *w, t, q, v);
            return;
        }
        std::vector<int> candidates;
        if (n > 0) {
            kinematics(p->mechanism, w->terms, q, v);
            evaluate_rows(*p, *w, t, v);
            w->warm = false;
        }
        for (int e = 0; e < n; ++e) {
            w->mode[e] = 1;
            if (at_rest(*p, *w, e, v)) {
                candidates.push_back(e);
                continue;
            }
            const Friction& f = p->frictions[e];
            if (f.dim == 1) w->mode[e] = w->values[f.block].rate[0] > 0.0 ? 1 : -1;
            else {
                Vec3 u = Vec3::Zero();
                for (int k = 0; k < f.dim; ++k) u[k] = w->values[f.block].rate[k];
                w->slip_direction[e] = w->last_direction[e] = u.normalized();
            }
        }
        resolve_modes(*p, *w, t, q, v, candidates);
    }

    // Writes the acceleration into `out`, an array of nv numbers; plain buffers, since this is called in tight loops.
    void acceleration(nb::handle q_in, nb::handle v_in, double t, nb::handle tau, nb::handle out) {
        read_buffer(q_in, q);
        if (!has_unit_lengths(p->mechanism, q.data(), unit_tolerance))
            throw std::invalid_argument("q holds a part that is not of unit length");
        read_buffer(v_in, v);
        if (!std::isfinite(t)) throw std::invalid_argument("expected a finite time");
        w->has_override = !tau.is_none();
        if (w->has_override) read_buffer(tau, w->override_torque);
        if (p->frictions.empty()) begin_step(*p, *w, t, q, v);
        else choose_modes(t, nb::none());
        const Buffer target(out, PyBUF_WRITABLE);
        target.check(w->a.size());
        std::copy(w->a.data(), w->a.data() + w->a.size(), target.data());
    }

    nb::dict solve(const Array& q_in, const Array& v_in, double t, nb::object tau, nb::object modes) {
        set(q_in, v_in, tau);
        choose_modes(t, modes);
        if (p->needs_reactions) gather_reactions(*p, *w);
        nb::dict out;
        nb::list forces, limits, used;
        for (size_t e = 0; e < p->frictions.size(); ++e) {
            const Vec3 f = friction_force(*p, *w, static_cast<int>(e));
            forces.append(to_numpy(f.data(), p->frictions[e].dim));
            limits.append(w->mode[e] == sticking ? static_limit(*p, *w, static_cast<int>(e), t, q, v) : w->limit[e]);
            used.append(static_cast<int>(w->mode[e]));
        }
        Split split;
        split_forces(*p, *w, split);
        out["a"] = to_numpy(w->a);
        out["F_ideal"] = to_numpy(split.F_ideal);
        out["F_nonideal"] = to_numpy(split.F_nonideal);
        out["C"] = to_numpy(split.C);
        out["F"] = to_numpy(w->F);
        out["lam"] = to_numpy(split.lam);
        out["lam_ideal"] = to_numpy(split.lam_ideal);
        out["rank"] = constraint_rank();
        out["modes"] = used;
        out["friction"] = forces;
        out["limits"] = limits;
        return out;
    }

    int constraint_rank() const {
        int rank = 0;
        for (int i = 0; i < p->constraints; ++i)
            for (size_t k = 0; k < p->blocks[i].kept.size(); ++k) rank += w->rows.active[p->blocks[i].row + k];
        return rank;
    }

    // All rows of all constraints, dropped ones too: A, b, residual, rate.
    nb::tuple rows(const Array& q_in, const Array& v_in, double t) {
        set(q_in, v_in, nb::none());
        kinematics(p->mechanism, w->terms, q, v);
        evaluate_rows(*p, *w, t, v);
        const int nv = p->mechanism.nv;
        std::vector<double> A(static_cast<size_t>(p->user_rows) * nv, 0.0), b, phi, rate;
        for (int i = 0; i < p->constraints; ++i) {
            Block all = p->blocks[i];
            all.kept.clear();
            for (int k = 0; k < all.total; ++k) all.kept.push_back(k);
            const RowValues& values = w->values[i];
            std::vector<double> local(all.support.size() * all.total);
            fill_A(all, w->terms, values, local.data());
            for (int k = 0; k < all.total; ++k) {
                for (size_t l = 0; l < all.support.size(); ++l)
                    A[static_cast<size_t>(all.user_row + k) * nv + all.support[l]] = local[l * all.total + k];
                b.push_back(-values.drift[k]);
                phi.push_back(values.residual[k]);
                rate.push_back(values.rate[k]);
            }
        }
        return nb::make_tuple(to_numpy(A), to_numpy(b), to_numpy(phi), to_numpy(rate));
    }

    // M (dense, by rows) and the bias forces.
    nb::tuple terms(const Array& q_in, const Array& v_in) {
        set(q_in, v_in, nb::none());
        kinematics(p->mechanism, w->terms, q, v);
        inertia(p->mechanism, w->terms);
        const Mechanism& m = p->mechanism;
        std::vector<double> M(static_cast<size_t>(m.nv) * m.nv, 0.0);
        for (int k = 0; k < m.nv; ++k)
            for (int i = k, s = 0; i >= 0; i = m.dof_parent[i], ++s)
                M[k * m.nv + i] = M[i * m.nv + k] = w->terms.M[m.row_offset[k] + s];
        return nb::make_tuple(to_numpy(M), to_numpy(w->terms.nle));
    }

    // q and v on the constraints, and the largest residual before (beyond `far` nothing moves), residual and rate after.
    nb::tuple project_state(const Array& q_in, const Array& v_in, double t, double far) {
        set(q_in, v_in, nb::none());
        double before, after, rate;
        look_at(*p, *w, t, q, v);
        violations(*p, *w, before, rate);
        after = before;
        if (before <= far) {
            project_here(t);
            look_at(*p, *w, t, q, v);
            violations(*p, *w, after, rate);
        }
        return nb::make_tuple(to_numpy(q), to_numpy(v), before, after, rate);
    }

    void project_here(double t) {
        std::fill(w->mode.begin(), w->mode.end(), static_cast<signed char>(1));
        want_rows(*p, *w);
        kinematics(p->mechanism, w->terms, q, v);
        inertia(p->mechanism, w->terms);
        factor_mass(*p, *w, t);
        evaluate_rows(*p, *w, t, v);
        if (!w->rows.blocks.empty()) {
            scale_rows(*p, *w);
            decide_rows(p->layout, p->blocks, w->B, w->rows);
            factor_rows(p->layout, p->blocks, w->B, w->rows);
            project(*p, *w, t, q, v);
        }
    }

    // For integrators outside the core: the rate of y = (q, v, states of laws, work of the ledger's columns).
    nb::object derivative(double t, const Array& y_in, bool energy) {
        System system(*p, *w, energy);
        const VecX y = read_state(system, map(y_in));
        VecX rate(system.ny);
        choose_modes(t, nb::none());
        system.collect(t, y, rate);
        return to_numpy(rate.data(), system.ny - system.ne);
    }

    // Such a y put on the constraints, and the energy that this moved.
    nb::tuple settle(double t, const Array& y_in, bool with_energy) {
        System system(*p, *w, with_energy);
        VecX y = read_state(system, map(y_in));
        const double before = energy();
        project_here(t);
        normalize(p->mechanism, q.data());
        y.head(system.nq) = q;
        y.segment(system.nq, system.nv) = v;
        return nb::make_tuple(to_numpy(y.data(), system.ny - system.ne), energy() - before);
    }

    // Samples of such a run as the core records its own; `moved` is the energy moved by projection up to each.
    nb::dict record(const Array& times, const Array2& states, const Array& moved, const nb::dict& options) {
        const RecordOptions wanted = read_record(options);
        System system(*p, *w, wanted.energy);
        Recording out;
        Recorder recorder(system, wanted, out);
        for (size_t k = 0; k < times.shape(0); ++k) {
            const double* row = states.data() + k * states.shape(1);
            const VecX y = read_state(system, Eigen::Map<const VecX>(row, states.shape(1)));
            choose_modes(times.data()[k], nb::none());
            recorder.moved_energy = moved.data()[k];
            recorder.sample(times.data()[k], y, true);
        }
        return hand_over(*w, out);
    }

    // Such a y with the core's watch of sticking elements behind it.
    VecX read_state(const System& system, const VecX& outside) {
        VecX y = VecX::Zero(system.ny);
        if (outside.size() != system.ny - system.ne) throw std::invalid_argument("y does not fit the scene");
        y.head(outside.size()) = outside;
        q = y.head(system.nq);
        v = y.segment(system.nq, system.nv);
        if (system.nz > 0) w->z = y.segment(system.nq + system.nv, system.nz);
        w->has_override = false;
        return y;
    }

    double energy() {
        kinematics(p->mechanism, w->terms, q, v);
        inertia(p->mechanism, w->terms);
        return kinetic_energy(p->mechanism, w->terms, v) + potential_energy(p->mechanism, w->terms);
    }

    double time_evaluations(const Array& q_in, const Array& v_in, double t, int count) {
        set(q_in, v_in, nb::none());
        choose_modes(t, nb::none());
        const auto begin = std::chrono::steady_clock::now();
        for (int i = 0; i < count; ++i) evaluate(*p, *w, t, q, v);
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() / count;
    }
};

Options read_options(const nb::dict& d) {
    Options o;
    o.method = method_named(nb::cast<std::string>(d["method"]));
    o.t0 = nb::cast<double>(d["t0"]);
    o.duration = nb::cast<double>(d["duration"]);
    o.rtol = nb::cast<double>(d["rtol"]);
    o.dt = nb::cast<double>(d["dt"]);
    o.output_dt = nb::cast<double>(d["output_dt"]);
    read_into(nb::cast<nb::object>(d["atol"]), o.atol);
    o.record = read_record(d);
    const nb::object tick = nb::cast<nb::object>(d["tick"]);
    o.tick = [tick, last = std::chrono::steady_clock::now()](double t) mutable {
        const auto now = std::chrono::steady_clock::now();
        if (now - last < std::chrono::milliseconds(50)) return;
        last = now;
        nb::gil_scoped_acquire gil;
        if (PyErr_CheckSignals() != 0) throw nb::python_error();
        if (!tick.is_none()) tick(t);
    };
    const nb::object save = nb::cast<nb::object>(d["save"]);
    if (save.is_none()) return o;
    o.save = [save](const std::string& state) {
        nb::gil_scoped_acquire gil;
        save(nb::bytes(state.data(), state.size()));
    };
    o.save_interval = std::chrono::duration_cast<Clock::duration>(
        std::chrono::duration<double>(nb::cast<double>(d["save_interval"])));
    return o;
}

}  // namespace

NB_MODULE(_core, m) {
    nb::set_leak_warnings(false);  // a user's function may hold the scene that holds it: a cycle, not a fault
    m.attr("pinocchio_version") = PIN_NONIDEAL_PINOCCHIO_VERSION;
    // Changes with the members of what a checkpoint holds.
    m.attr("state_layout") = std::to_string(sizeof(Workspace)) + "." + std::to_string(sizeof(Simulation)) + "." +
                             std::to_string(sizeof(long)) + " for Pinocchio " PIN_NONIDEAL_PINOCCHIO_VERSION;

    static PyObject* core_failure = nb::exception<Failure>(m, "CoreFailure").ptr();
    (void)core_failure;

    nb::class_<ReactionView>(m, "ReactionView")
        .def_prop_ro("lam", &ReactionView::lam)
        .def("of_joint", &ReactionView::of_joint)
        .def("of_block", &ReactionView::of_block);

    nb::class_<Builder>(m, "Builder")
        .def(nb::init<nb::object>())
        .def("add_point", [](Builder& b, const std::string& name, const FrameTuple& f1, const FrameTuple& f2,
                             std::vector<int> axes) {
            return b.add(name, PointRows{frame_of(f1), frame_of(f2), std::move(axes)}, true);
        })
        .def("add_contact", [](Builder& b, const std::string& name, const FrameTuple& f1, const FrameTuple& f2,
                               const std::vector<double>& normal, double radius) {
            const int block = b.add(name, ContactRow{frame_of(f1), frame_of(f2), vec3(normal), radius}, true);
            b.p->contacts.push_back(block);
            return block;
        })
        .def("add_frame", [](Builder& b, const std::string& name, const FrameTuple& f1, const FrameTuple& f2) {
            return b.add(name, FrameRows{frame_of(f1), frame_of(f2)}, true);
        })
        .def("add_hinge", [](Builder& b, const std::string& name, const FrameTuple& f1, const FrameTuple& f2,
                             const std::vector<double>& axis, const std::vector<double>& n1,
                             const std::vector<double>& n2) {
            return b.add(name, HingeRows{frame_of(f1), frame_of(f2), vec3(axis), vec3(n1), vec3(n2)}, true);
        })
        .def("add_distance", [](Builder& b, const std::string& name, const FrameTuple& f1, const FrameTuple& f2,
                                nb::object length) {
            return b.add(name, DistanceRows{frame_of(f1), frame_of(f2), time_function(length)}, true);
        })
        .def("add_knife", [](Builder& b, const std::string& name, const FrameTuple& f1,
                             const std::vector<double>& axis) {
            return b.add(name, KnifeRows{frame_of(f1), Frame{}, vec3(axis)}, true);
        })
        .def("add_rolling", [](Builder& b, const std::string& name, const FrameTuple& f1, const FrameTuple& f2,
                               double radius, bool sphere, const std::vector<double>& axle,
                               const std::vector<double>& t1, const std::vector<double>& t2,
                               const std::vector<double>& n) {
            return b.add(name, RollingRows{frame_of(f1), frame_of(f2), radius, sphere, vec3(axle), vec3(t1), vec3(t2),
                                           vec3(n)}, true);
        })
        .def("add_coupling", [](Builder& b, const std::string& name, int joint1, int joint2, double ratio,
                                double offset, double period, bool position) {
            return b.add(name, CouplingRows{joint1, joint2, ratio, offset, period, position}, true);
        })
        .def("add_motion", [](Builder& b, const std::string& name, int joint, nb::object function, double period) {
            return b.add(name, MotionRows{joint, time_function(function), period}, true);
        })
        .def("add_user", [](Builder& b, const std::string& name, int size, nb::object rows, nb::object residual,
                            nb::object rate) {
            UserRows user;
            user.rows = [rows](double t, const VecX& q, const VecX& v, MatX& A, VecX& rhs) {
                nb::gil_scoped_acquire gil;
                const auto [A_out, b_out] = nb::cast<std::pair<Array2, Array>>(rows(t, to_numpy(q), to_numpy(v)));
                using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
                A = Eigen::Map<const RowMajor>(A_out.data(), A.rows(), A.cols());
                rhs.head(A.rows()) = map(b_out);
            };
            if (!residual.is_none())
                user.residual = [residual](double t, const VecX& q, VecX& phi) {
                    nb::gil_scoped_acquire gil;
                    const Array value = nb::cast<Array>(residual(t, to_numpy(q)));
                    phi.head(value.shape(0)) = map(value);
                };
            if (!rate.is_none())
                user.rate = [rate](double t, const VecX& q, const VecX& v, VecX& out) {
                    nb::gil_scoped_acquire gil;
                    const Array value = nb::cast<Array>(rate(t, to_numpy(q), to_numpy(v)));
                    out.head(value.shape(0)) = map(value);
                };
            return b.add(name, std::move(user), true, size);
        }, "name"_a, "size"_a, "rows"_a, "residual"_a.none(), "rate"_a.none())
        // Directions of friction; they follow all constraints.
        .def("add_dof_slip", [](Builder& b, const std::string& name, int dof, int count) {
            return b.add(name, DofRows{dof, count}, false);
        })
        .def("add_hinge_slip", [](Builder& b, const std::string& name, const FrameTuple& f1, const FrameTuple& f2,
                                  const std::vector<double>& axis) {
            return b.add(name, HingeSlipRows{frame_of(f1), frame_of(f2), vec3(axis)}, false);
        })
        .def("add_contact_slip", [](Builder& b, const std::string& name, const FrameTuple& f1, const FrameTuple& f2,
                                    double radius, const std::vector<double>& t1, const std::vector<double>& t2,
                                    const std::vector<double>& n) {
            return b.add(name, ContactSlipRows{frame_of(f1), frame_of(f2), radius, vec3(t1), vec3(t2), vec3(n)}, false);
        })
        .def("add_user_slip", [](Builder& b, const std::string& name, nb::object direction) {
            return b.add(name, UserSlipRow{[direction](double t, const VecX& q, VecX& row) {
                nb::gil_scoped_acquire gil;
                read_into(direction(t, to_numpy(q)), row);
            }}, false);
        })
        .def("keep_rows", [](Builder& b, int block, std::vector<int> rows) { b.p->blocks[block].kept = std::move(rows); })
        .def("add_law", &Builder::add_law)
        .def("add_friction", [](Builder& b, const std::string& name, int law, int block, const std::string& load,
                                const std::string& reaction, int joint, int anchor, const std::vector<double>& axis,
                                const nb::dict& x, nb::object user_limit) {
            Friction f;
            f.name = name;
            f.law = law;
            f.block = block;
            f.dim = b.p->blocks[block].total;
            using L = Friction::Load;
            f.load = load == "revolute" ? L::revolute : load == "prismatic" ? L::prismatic
                     : load == "spherical" ? L::spherical : load == "contact" ? L::contact
                     : load == "user" ? L::user : L::none;
            f.reaction = reaction == "total" ? Reaction::total : reaction == "ideal" ? Reaction::ideal : Reaction::none;
            f.joint = joint;
            f.anchor = anchor;
            f.axis = vec3(axis);
            f.constant = nb::cast<double>(x["constant"]);
            f.mu = nb::cast<double>(x["mu"]);
            f.radius = nb::cast<double>(x["radius"]);
            f.axial_radius = nb::cast<double>(x["axial_radius"]);
            f.inverse_span = nb::cast<double>(x["inverse_span"]);
            f.static_ratio = nb::cast<double>(x["static_ratio"]);
            f.stribeck_velocity = nb::cast<double>(x["stribeck_velocity"]);
            if (!user_limit.is_none()) {
                const Program* p = b.p.get();
                f.user_limit = [user_limit, p](double t, const VecX& q, const VecX& v, Workspace& w) {
                    nb::gil_scoped_acquire gil;
                    return nb::cast<double>(user_limit(t, to_numpy(q), to_numpy(v), ReactionView{p, &w}));
                };
            }
            b.p->frictions.push_back(std::move(f));
            return static_cast<int>(b.p->frictions.size()) - 1;
        }, "name"_a, "law"_a, "block"_a, "load"_a, "reaction"_a, "joint"_a, "anchor"_a, "axis"_a, "numbers"_a,
           "user_limit"_a.none())
        .def("add_viscous", [](Builder& b, int law, int dof, int count, int block, double coefficient) {
            b.p->viscous.push_back({law, dof, count, block, coefficient});
        })
        .def("add_drag", [](Builder& b, int law, const FrameTuple& frame, double coefficient, double exponent) {
            b.p->drags.push_back({law, frame_of(frame), coefficient, exponent, {}});
        })
        .def("add_sigmoid", [](Builder& b, int law, int dof, double phi1, double phi2, double phi3) {
            b.p->sigmoids.push_back({law, dof, phi1, phi2, phi3});
        })
        .def("add_bristle", [](Builder& b, int law, int dof, double sigma0, double sigma1, double sigma2,
                               double coulomb, double stiction, double stribeck_velocity) {
            b.p->bristles.push_back({law, dof, b.p->states, sigma0, sigma1, sigma2, coulomb, stiction,
                                     stribeck_velocity});
            ++b.p->states;
        })
        .def("add_user_law", [](Builder& b, int law, int states, const std::string& reaction, nb::object function) {
            UserLaw u;
            u.law = law;
            u.state = b.p->states;
            u.states = states;
            b.p->states += states;
            u.reaction = reaction == "total" ? Reaction::total : reaction == "ideal" ? Reaction::ideal : Reaction::none;
            const Program* p = b.p.get();
            const bool reads = u.reaction != Reaction::none;
            u.function = [function, p, states, reads](double t, const VecX& q, const VecX& v, Workspace& w, VecX& C,
                                                      const double* z, double* dz) {
                nb::gil_scoped_acquire gil;
                nb::object view = reads ? nb::cast(ReactionView{p, &w}) : nb::none();
                if (states == 0) {
                    read_into(function(t, to_numpy(q), to_numpy(v), view), C);
                    return;
                }
                const auto [force, rate] = nb::cast<std::pair<Array, Array>>(
                    function(t, to_numpy(q), to_numpy(v), view, to_numpy(z, states)));
                C = map(force);
                std::copy(rate.data(), rate.data() + states, dz);
            };
            b.p->user_laws.push_back(std::move(u));
        })
        .def("add_spring_damper", [](Builder& b, const FrameTuple& f1, const FrameTuple& f2, double stiffness,
                                     double damping, double rest_length) {
            b.p->forces.push_back(SpringDamper{frame_of(f1), frame_of(f2), stiffness, damping, rest_length});
        })
        .def("add_joint_spring", [](Builder& b, int joint, double stiffness, double rest, double damping) {
            b.p->forces.push_back(JointSpring{joint, stiffness, rest, damping});
        })
        .def("add_wrench", [](Builder& b, const FrameTuple& frame, const std::vector<double>& six, nb::object function) {
            FrameWrench wrench{frame_of(frame), {}, {}};
            std::copy(six.begin(), six.end(), wrench.value);
            if (!function.is_none())
                wrench.function = [function](double t, double* out) {
                    nb::gil_scoped_acquire gil;
                    const Array value = nb::cast<Array>(function(t));
                    std::copy(value.data(), value.data() + 6, out);
                };
            b.p->forces.push_back(std::move(wrench));
        }, "frame"_a, "value"_a, "function"_a.none())
        .def("add_user_force", [](Builder& b, nb::object f) { b.p->forces.push_back(UserForce{torque_function(f)}); })
        .def("set_constant_torque", [](Builder& b, Array tau) { b.p->actuation = ConstantTorque{column(tau)}; })
        .def("set_torque_function", [](Builder& b, nb::object f) { b.p->actuation = TorqueFunction{torque_function(f)}; })
        .def("set_sampled_torque", [](Builder& b, nb::object f, double period) {
            b.p->actuation = SampledTorque{torque_function(f), period};
        })
        .def("set_hold_position", [](Builder& b, Array kp, Array kd, Array q) {
            b.p->actuation = HoldPosition{column(kp), column(kd), column(q)};
        })
        .def("set_torque_table", [](Builder& b, std::vector<double> times, Array2 values) {
            TorqueTable table{std::move(times), MatX(values.shape(1), values.shape(0))};
            for (size_t i = 0; i < values.shape(0); ++i)
                for (size_t j = 0; j < values.shape(1); ++j) table.values(j, i) = values(i, j);
            b.p->actuation = std::move(table);
        })
        .def("finish", [](Builder& b) { b.p->finish(); })
        .def_prop_ro("states", [](Builder& b) { return b.p->states; })
        .def("runner", [](Builder& b) { return new Runner(b.p); }, nb::rv_policy::take_ownership);

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
            const RowSystem& s = r.w->rows;
            return nb::make_tuple(s.min_pivot, s.orthogonal, s.redundant, s.refine);
        })
        .def("simulate", [](Runner& r, const Array& q, const Array& v, const Array& z, const nb::dict& options) {
            const Options o = read_options(options);
            const VecX q0 = map(q), v0 = map(v);
            r.w->z = map(z);
            r.w->has_override = false;
            Recording recording;
            {
                nb::gil_scoped_release release;
                simulate(*r.p, *r.w, q0, v0, o, recording);
            }
            return hand_over(*r.w, recording);
        })
        .def("resume", [](Runner& r, nb::bytes state, const nb::dict& options) {
            const Options o = read_options(options);
            const std::string bytes(static_cast<const char*>(state.data()), state.size());
            Recording recording;
            {
                nb::gil_scoped_release release;
                resume(*r.p, *r.w, bytes, o, recording);
            }
            return hand_over(*r.w, recording);
        });

    // Many states in native threads, one workspace a thread.
    m.def("rollout", [](Builder& b, const Array2& q, const Array2& v, const Array& z, const nb::dict& options,
                        int threads) {
        const size_t count = q.shape(0);
        std::vector<Recording> recordings(count);
        std::vector<std::unique_ptr<Workspace>> spaces;
        for (size_t i = 0; i < count; ++i) spaces.emplace_back();
        // Copied here and not in the threads: options hold Python's objects, whose counts need the lock.
        const Options o = read_options(options);
        Options silent = o;
        silent.tick = nullptr;
        const VecX z0 = map(z);
        std::vector<VecX> q0, v0;
        for (size_t i = 0; i < count; ++i) {
            q0.push_back(Eigen::Map<const VecX>(q.data() + i * q.shape(1), q.shape(1)));
            v0.push_back(Eigen::Map<const VecX>(v.data() + i * v.shape(1), v.shape(1)));
        }
        const Program& p = *b.p;
        {
            nb::gil_scoped_release release;
            std::atomic<size_t> next{0};
            const auto work = [&](const Options& mine) {
                for (size_t i = next++; i < count; i = next++) {
                    spaces[i] = std::make_unique<Workspace>(p);
                    spaces[i]->z = z0;
                    simulate(p, *spaces[i], q0[i], v0[i], mine, recordings[i]);
                }
            };
            std::vector<std::thread> pool;
            for (int k = 1; k < threads; ++k) pool.emplace_back(work, std::cref(silent));
            work(o);
            for (std::thread& thread : pool) thread.join();
        }
        nb::list out;
        for (size_t i = 0; i < count; ++i) out.append(hand_over(*spaces[i], recordings[i]));
        return out;
    });

    // The friction program on arrays, for tests against enumeration.
    m.def("friction_program", [](const Array2& W, const Array& alpha0, const std::vector<int>& dims,
                                 const Array& limits) {
        MatX matrix(W.shape(0), W.shape(1));
        for (size_t i = 0; i < W.shape(0); ++i)
            for (size_t j = 0; j < W.shape(1); ++j) matrix(i, j) = W(i, j);
        return to_numpy(friction_program(matrix, map(alpha0), dims, map(limits)));
    });
}
