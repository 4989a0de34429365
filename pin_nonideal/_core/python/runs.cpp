#include "python/runs.hpp"

#include <algorithm>
#include <cmath>

#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "dynamics/state_projection.hpp"
#include "python/failures.hpp"
#include "python/reused_run.hpp"
#include "python/options.hpp"
#include "python/run_programs.hpp"
#include "python/thread_pool.hpp"
#include "run/output/resampling.hpp"

using namespace nanobind::literals;

namespace pn {

namespace {

using Array3 = nb::ndarray<const double, nb::ndim<3>, nb::c_contig, nb::device::cpu>;
using Indices = nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Tick = Function<void(double)>;     // argument: time [s]
using Save = Function<void(nb::bytes)>;  // argument: state of a checkpoint
using Hint = Function<void(double, int, double, bool)>;  // arguments: time [s], dof, rate [1/s], decays

// Check Python's signals and report progress between two steps, at most every 50 ms.
void watch(Options& o, const Tick& tick) {
    o.tick = [tick, last = std::chrono::steady_clock::now()](double t) mutable {
        const auto now = std::chrono::steady_clock::now();
        if (now - last < std::chrono::milliseconds(50)) return;
        last = now;
        nb::gil_scoped_acquire gil;
        if (PyErr_CheckSignals() != 0) throw nb::python_error();
        if (tick) (*tick)(t);
    };
}

void keep(Options& o, const Save& save, double interval) {
    if (!save) return;
    o.save = [save](const std::string& state) {
        nb::gil_scoped_acquire gil;
        (*save)(nb::bytes(state.data(), state.size()));
    };
    o.save_interval = std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(interval));
}

void set_hint(Options& o, const Hint& hint) {
    if (!hint) return;
    o.hint = [hint](double t, int dof, double rate, bool decays) {
        nb::gil_scoped_acquire gil;
        (*hint)(t, dof, rate, decays);
    };
}

// Compute samples inside the steps of a run with record "dense" from interpolated states and the data of each step.
Outcome samples_inside(const Program& p, const Options& options, const Array& t, const Array2& y, const Array2& modes,
                      const Array2& closed, const Indices& turning, const Array2& directions, const Array2& sought,
                      const Array2& torque, const Array& moved, const Array& impacts) {
    InsideStates inside;
    inside.t.assign(t.data(), t.data() + t.shape(0));
    inside.moved.assign(moved.data(), moved.data() + moved.shape(0));
    inside.impacts.assign(impacts.data(), impacts.data() + impacts.shape(0));
    inside.turning.assign(turning.data(), turning.data() + turning.shape(0));
    inside.end = options.end();
    const size_t elements = p.frictions.size(), gaps = p.gaps.size();
    for (size_t k = 0; k < t.shape(0); ++k) {
        inside.y.emplace_back(map(y).row(k));
        inside.directions.emplace_back(map(directions).row(k));
        if (torque.shape(0) > 0) inside.torque.emplace_back(map(torque).row(k));
        std::vector<Mode> held(elements);
        std::vector<char> is_sought(elements);
        for (size_t e = 0; e < elements; ++e) {
            held[e] = static_cast<Mode>(static_cast<int>(map(modes)(k, e)));
            is_sought[e] = map(sought)(k, e) != 0.0;
        }
        std::vector<char> is_closed(gaps);
        for (size_t i = 0; i < gaps; ++i) is_closed[i] = map(closed)(k, i) != 0.0;
        inside.modes.push_back(std::move(held));
        inside.sought.push_back(std::move(is_sought));
        inside.closed.push_back(std::move(is_closed));
    }
    Workspace w(p);
    w.continues = options.continues;
    Recording out;
    sample_inside(p, w, inside, options.record, out);
    return {w.counters, std::move(out)};
}

// Return the states at fractions of the steps of an interpolant, from its values at the points of each step.
Numbers inside_steps(const Array3& states, const Indices& step, const Array& part) {
    const size_t size = states.shape(2);
    const StepPolynomials steps(states.data(), static_cast<int>(states.shape(1)), static_cast<int>(size));
    std::vector<double> out(part.shape(0) * size);
    for (size_t k = 0; k < part.shape(0); ++k) steps.at(step(k), part(k), out.data() + k * size);
    return to_numpy(std::move(out));
}

}  // namespace

std::vector<UserEvent> user_events(const std::vector<UserEventTuple>& given) {
    std::vector<UserEvent> events;
    for (const auto& [function, direction, terminal] : given) {
        const auto call = [f = function, q_in = HandedArray(), v_in = HandedArray()](double t, const VecX& q,
                                                                                     const VecX& v) mutable {
            nb::gil_scoped_acquire gil;
            return nb::cast<double>(f(t, q_in(q), v_in(v)));
        };
        events.push_back({call, direction, terminal});
    }
    return events;
}

decltype(Options::callback) user_callback(const Callback& given) {
    if (!given) return {};
    return [f = *given, q_in = HandedArray(), v_in = HandedArray()](double t, const VecX& q, const VecX& v,
                                                                    VecX& torque) mutable {
        nb::gil_scoped_acquire gil;
        const nb::object answer = f(t, q_in(q), v_in(v));
        if (answer.is_none()) return Options::CallbackResult::proceed;
        if (answer.is(Py_True)) return Options::CallbackResult::stop;
        read_into(answer, torque);
        return Options::CallbackResult::torque;
    };
}

// Project many states onto the constraints on several threads, each as by Runner::project. Return q and v by rows, and
// the largest residual and rate of each state afterwards. Both are NaN if the projection failed.
static std::tuple<Numbers, Numbers, Numbers, Numbers> nearest_states(const Program& p, const Array2& q_in,
                                                                     const Array2& v_in, double t, double max_residual,
                                                                     int threads, const std::vector<NumberTuple>& names,
                                                                     const Array2& values) {
    RowMajor q = map(q_in), v = map(v_in);
    VecX after = VecX::Constant(q.rows(), NAN), rate = after;
    const int useful = useful_threads(q.rows(), threads);
    RunPrograms programs(p, names, values, useful);
    std::vector<std::unique_ptr<Workspace>> spaces(useful);
    std::atomic<bool> stopped{false};
    parallel_for(q.rows(), threads, stopped, [&](size_t i, int k) {
        const Program& mine = programs.of(i, k);
        // A workspace caches terms of its configuration, which other parameters change.
        if (!spaces[k] || !names.empty()) spaces[k] = std::make_unique<Workspace>(mine);
        VecX q_one = q.row(i), v_one = v.row(i);
        try {
            const Closure found = close(mine, *spaces[k], t, q_one, v_one, max_residual);
            after[i] = found.after;
            rate[i] = found.rate;
            q.row(i) = q_one;
            v.row(i) = v_one;
        } catch (...) {
            // The error is reported when the state is projected alone.
        }
    });
    return {to_numpy(q.data(), q.size()), to_numpy(v.data(), v.size()), to_numpy(after), to_numpy(rate)};
}

// Return a program with the parameters of one run.
static std::shared_ptr<const Program> with_numbers(const Program& p, const std::vector<NumberTuple>& names,
                                                   const Array2& values) {
    return std::make_shared<Program>(RunPrograms(p, names, values, 1).of(0, 0));
}

static bool is_interrupt(const std::exception_ptr& error) {
    if (!error) return false;
    nb::gil_scoped_acquire gil;
    try {
        std::rethrow_exception(error);
    } catch (const nb::python_error& e) {
        return e.matches(PyExc_KeyboardInterrupt);
    } catch (...) {
        return false;
    }
}

// Return the outcomes of runs from many states, on several threads, each with its own workspace. An interrupt stops all
// runs. Runs that have not begun are None.
static nb::typed<nb::list, std::optional<Outcome>> rollout(const Program& p, const Array2& q, const Array2& v,
                                                           Options options, int threads,
                                                           const std::vector<NumberTuple>& names, const Array2& values) {
    const size_t count = q.shape(0);
    const int useful = useful_threads(count, threads);
    RunPrograms programs(p, names, values, useful);
    std::vector<ThreadWorkspace> workspaces(useful);
    std::vector<std::optional<Outcome>> outcomes(count);
    std::atomic<bool> stopped{false};
    const auto stop = [&stopped](double t) {
        if (stopped) throw EndOfRun{Failure(Failure::Kind::interrupted, t)};
    };
    Options own = options;  // options of the caller's thread, which receives Python's signals
    watch(own, {});
    own.tick = [stop, signals = own.tick](double t) {
        stop(t);
        signals(t);
    };
    options.tick = stop;
    const auto q_all = map(q), v_all = map(v);
    try {
        parallel_for(count, threads, stopped, [&](size_t i, int k) {
            const bool anew = !names.empty() || options.record.dense;
            ThreadWorkspace& workspace = workspaces[k];
            workspace.run_from(programs.of(i, k), k == 0 ? own : options, anew, q_all.row(i), v_all.row(i));
            if (is_interrupt(workspace.run.out.error)) stopped = true;
            outcomes[i] = Outcome{workspace.own->counters, std::exchange(workspace.run.out, {})};
        });
    } catch (...) {  // the outcome of an interrupted run reports the interrupt
        const auto was_interrupted = [](const std::optional<Outcome>& one) {
            const auto failure = one ? one->recording.failure : std::nullopt;
            return failure && failure->kind == Failure::Kind::interrupted;
        };
        const bool any_interrupted = std::any_of(outcomes.begin(), outcomes.end(), was_interrupted);
        if (!is_interrupt(std::current_exception()) || !any_interrupted) throw;
    }
    nb::typed<nb::list, std::optional<Outcome>> out;
    for (std::optional<Outcome>& one : outcomes) out.append(one ? nb::cast(std::move(*one)) : nb::none());
    return out;
}

void bind_runs(nb::module_& m, nb::class_<Runner>& runner) {
    nb::class_<Method>(m, "Method")
        .def_prop_ro("name", [](const Method& method) { return std::string(method.name); })
        .def_prop_ro("adaptive", &Method::adaptive)
        .def_prop_ro("outside", &Method::outside)
        .def_prop_ro("one_step", [](const Method& method) { return method.one_step; });
    m.def("methods", [] { return methods(); });
    bind_outcome(m);
    runner
        .def("simulate", [](Runner& r, const Array& q, const Array& v, const RunOptions& run_options, const Tick& tick,
                            const Save& save, double save_interval, const std::vector<UserEventTuple>& events,
                            const Callback& callback, const Hint& hint) {
            Options& options = r.read(run_options);
            watch(options, tick);
            set_hint(options, hint);
            keep(options, save, save_interval);
            options.events = user_events(events);
            options.callback = user_callback(callback);
            return r.simulate(q, v);
        }, "q"_a, "v"_a, "options"_a, "tick"_a = nb::none(), "save"_a = nb::none(), "save_interval"_a = 0.0,
           "events"_a = std::vector<UserEventTuple>(), "callback"_a = nb::none(), "hint"_a = nb::none())
        .def("resume", [](Runner& r, const nb::bytes& state, Options options, const Tick& tick, const Save& save,
                          double save_interval) {
            watch(options, tick);
            keep(options, save, save_interval);
            return r.resume(state, options);
        }, "state"_a, "options"_a, "tick"_a = nb::none(), "save"_a = nb::none(), "save_interval"_a = 0.0);
    m.def("nearest_states", &nearest_states, "program"_a, "q"_a, "v"_a, "t"_a, "max_residual"_a, "threads"_a,
          "names"_a, "values"_a);
    m.def("dense_points", [](const std::string& method) { return DenseRecorder::points(method_named(method)); }, "method"_a);
    m.def("inside_steps", &inside_steps, "states"_a, "step"_a, "part"_a);
    m.def("sample_inside", &samples_inside, "program"_a, "options"_a, "t"_a, "y"_a, "modes"_a, "closed"_a, "turning"_a,
          "directions"_a, "sought"_a, "torque"_a, "moved"_a, "impacts"_a);
    m.def("rollout", &rollout, "program"_a, "q"_a, "v"_a, "options"_a, "threads"_a,
          "names"_a, "values"_a);
    m.def("with_numbers", &with_numbers, "program"_a, "names"_a, "values"_a);
}

}  // namespace pn
