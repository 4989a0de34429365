#include "python/runs.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <condition_variable>
#include <mutex>
#include <system_error>
#include <thread>

#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "dynamics/projection.hpp"
#include "python/failures.hpp"
#include "python/options.hpp"

using namespace nanobind::literals;

namespace pn {

namespace {

using Tick = Function<void(double)>;     // with the time
using Save = Function<void(nb::bytes)>;  // with the state of a checkpoint

// Now and then between two steps: Python's signals, and progress.
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

// What stopped a run: a failure of the core, what a function of the user raised, or None.
nb::object stopped(const Outcome& outcome) {
    const Recording& r = outcome.recording;
    if (r.failure) return failure_object(*r.failure);
    if (!r.error) return nb::none();
    try {
        std::rethrow_exception(r.error);
    } catch (nb::python_error& e) {
        return nb::borrow(e.value());
    } catch (const std::exception& e) {
        return nb::handle(PyExc_RuntimeError)(e.what());
    }
}

// Recorded numbers as an array that keeps their run alive; empty when they were not recorded.
template <auto field>
auto recorded(nb::handle_t<Outcome> run) {
    auto& numbers = nb::cast<Outcome&>(run).recording.*field;
    numbers.reserve(1);  // an array has an address, one without numbers too
    using Number = typename std::decay_t<decltype(numbers)>::value_type;
    return nb::ndarray<nb::numpy, Number, nb::ndim<1>>(numbers.data(), {numbers.size()}, run);
}

}  // namespace

static int useful_threads(size_t count, int threads) { return static_cast<int>(std::min<size_t>(threads, count)); }

// Calls work(i, k) for every i below `count`, drawn from one counter by threads k; number 0 is the caller's. What one of
// them throws, a signal of Python's among it, stops the drawing and is thrown at the end.
template <class Work>
static void share_out(size_t count, int threads, std::atomic<bool>& stopped, Work work) {
    nb::gil_scoped_release release;
    std::atomic<size_t> next{0};
    std::mutex mutex;
    std::condition_variable ended;
    int running = 0;
    std::exception_ptr error;
    const auto keep = [&](const std::exception_ptr& thrown) {
        const std::lock_guard<std::mutex> guard(mutex);
        if (!error) error = thrown;
        stopped = true;
    };
    const auto draw = [&](int k) {
        try {
            for (size_t i = next++; i < count && !stopped; i = next++) work(i, k);
        } catch (...) {
            keep(std::current_exception());
        }
    };
    const auto follow = [&](int k) {
        draw(k);
        const std::lock_guard<std::mutex> guard(mutex);
        --running;
        ended.notify_one();
    };
    const int useful = useful_threads(count, threads);
    std::vector<std::thread> pool;
    pool.reserve(useful);
    for (int k = 1; k < useful; ++k) {
        std::unique_lock<std::mutex> guard(mutex);
        try {
            pool.emplace_back(follow, k);
        } catch (const std::system_error&) {
            break;  // fewer threads do the same work
        }
        ++running;
    }
    draw(0);
    std::unique_lock<std::mutex> guard(mutex);
    while (!ended.wait_for(guard, std::chrono::milliseconds(50), [&] { return running == 0; })) {
        guard.unlock();
        {
            nb::gil_scoped_acquire gil;
            if (PyErr_CheckSignals() != 0) keep(std::make_exception_ptr(nb::python_error()));
        }
        guard.lock();
    }
    guard.unlock();
    for (std::thread& thread : pool) thread.join();
    if (error) std::rethrow_exception(error);
}

// q and v of many states on the constraints, by rows, and the largest residual and rate of each afterwards: NaN where
// the state could not be taken. On several threads, each state as by Runner::project.
static std::tuple<Numbers, Numbers, Numbers, Numbers> nearest_states(const Program& p, const Array2& q_in,
                                                                     const Array2& v_in, double t, double far,
                                                                     int threads) {
    RowMajor q = map(q_in), v = map(v_in);
    VecX after = VecX::Constant(q.rows(), NAN), rate = after;
    std::vector<std::unique_ptr<Workspace>> spaces(useful_threads(q.rows(), threads));
    std::atomic<bool> stopped{false};
    share_out(q.rows(), threads, stopped, [&](size_t i, int k) {
        if (!spaces[k]) spaces[k] = std::make_unique<Workspace>(p);
        VecX q_one = q.row(i), v_one = v.row(i);
        try {
            const Closure found = close(p, *spaces[k], t, q_one, v_one, far);
            after[i] = found.after;
            rate[i] = found.rate;
            q.row(i) = q_one;
            v.row(i) = v_one;
        } catch (...) {
            // Told where the state is taken alone.
        }
    });
    return {to_numpy(q.data(), q.size()), to_numpy(v.data(), v.size()), to_numpy(after), to_numpy(rate)};
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

// Outcomes of runs from many states, on several threads, each with a workspace of its own. Where one is interrupted
// all stop, and those not begun are None.
static nb::typed<nb::list, std::optional<Outcome>> rollout(const Program& p, const Array2& q, const Array2& v,
                                                           Options options, int threads) {
    const size_t count = q.shape(0);
    std::vector<std::optional<Outcome>> outcomes(count);
    std::atomic<bool> stopped{false};
    const auto stop = [&stopped](double t) {
        if (stopped) throw Failure(Failure::Kind::interrupted, t);
    };
    Options own = options;  // of the caller's thread, to which Python tells its signals
    watch(own, {});
    own.tick = [stop, signals = own.tick](double t) {
        stop(t);
        signals(t);
    };
    options.tick = stop;
    const auto q_all = map(q), v_all = map(v);
    try {
        share_out(count, threads, stopped, [&](size_t i, int k) {
            Workspace space(p);
            Recording mine;  // neighbors in one array would share lines of cache between the threads
            simulate(p, space, q_all.row(i), v_all.row(i), k == 0 ? own : options, mine);
            if (is_interrupt(mine.error)) stopped = true;
            outcomes[i] = Outcome{space.counters, std::move(mine)};
        });
    } catch (...) {  // a run that the interrupt ended tells of it
        const auto tells = [](const std::optional<Outcome>& one) {
            const auto failure = one ? one->recording.failure : std::nullopt;
            return failure && failure->kind == Failure::Kind::interrupted;
        };
        if (!is_interrupt(std::current_exception()) || std::none_of(outcomes.begin(), outcomes.end(), tells)) throw;
    }
    nb::typed<nb::list, std::optional<Outcome>> out;
    for (std::optional<Outcome>& one : outcomes) out.append(one ? nb::cast(std::move(*one)) : nb::none());
    return out;
}

static void bind_outcome(nb::module_& m) {
    using R = Recording;
    nb::enum_<Event::Kind> kinds(m, "EventKind", "What happened between two smooth stretches of a run.");
    for (const EventKind& each : event_kinds) kinds.value(each.name, each.kind, each.meaning);
    nb::class_<Event>(m, "Event")
        .def_ro("time", &Event::time)
        .def_ro("kind", &Event::kind)
        .def_ro("element", &Event::element);
    nb::class_<Outcome>(m, "Outcome")
        .def_prop_ro("t", recorded<&R::t>)
        .def_prop_ro("q", recorded<&R::q>)
        .def_prop_ro("v", recorded<&R::v>)
        .def_prop_ro("violation", recorded<&R::violation>)
        .def_prop_ro("violation_rate", recorded<&R::violation_rate>)
        .def_prop_ro("largest_violation", [](const Outcome& o) {
            double largest = 0.0;
            for (const double gap : o.recording.violation) largest = std::fmax(largest, gap);
            return largest;
        })
        .def_prop_ro("a", recorded<&R::a>)
        .def_prop_ro("F_ideal", recorded<&R::F_ideal>)
        .def_prop_ro("F_nonideal", recorded<&R::F_nonideal>)
        .def_prop_ro("lam", recorded<&R::lam>)
        .def_prop_ro("lam_ideal", recorded<&R::lam_ideal>)
        .def_prop_ro("energy", recorded<&R::energy>)
        .def_prop_ro("power", recorded<&R::power>)
        .def_prop_ro("z", recorded<&R::z>)
        .def_prop_ro("law_forces", recorded<&R::law_forces>)
        .def_prop_ro("limits", recorded<&R::limits>)
        .def_prop_ro("reactions", recorded<&R::reactions>)
        .def_prop_ro("modes", recorded<&R::modes>)
        .def_prop_ro("events", [](const Outcome& o) { return o.recording.events; })
        .def_prop_ro("steps", [](const Outcome& o) { return o.recording.steps; })
        .def_prop_ro("rejected", [](const Outcome& o) { return o.recording.rejected; })
        .def_prop_ro("evaluations", [](const Outcome& o) { return o.counters.evaluations; })
        .def_prop_ro("factorizations", [](const Outcome& o) { return o.counters.factorizations; })
        .def_prop_ro("projections", [](const Outcome& o) { return o.counters.projections; })
        .def_prop_ro("iterations", [](const Outcome& o) { return o.counters.iterations; })
        .def_prop_ro("stopped", stopped, nb::for_getter(nb::sig("def stopped(self) -> BaseException | None")));
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
        .def("simulate", [](Runner& r, const Array& q, const Array& v, Options options, const Tick& tick,
                            const Save& save, double save_interval) {
            watch(options, tick);
            keep(options, save, save_interval);
            return r.simulate(q, v, options);
        }, "q"_a, "v"_a, "options"_a, "tick"_a = nb::none(), "save"_a = nb::none(), "save_interval"_a = 0.0)
        .def("resume", [](Runner& r, const nb::bytes& state, Options options, const Tick& tick, const Save& save,
                          double save_interval) {
            watch(options, tick);
            keep(options, save, save_interval);
            return r.resume(state, options);
        }, "state"_a, "options"_a, "tick"_a = nb::none(), "save"_a = nb::none(), "save_interval"_a = 0.0);
    m.def("nearest_states", &nearest_states, "program"_a, "q"_a, "v"_a, "t"_a, "far"_a, "threads"_a);
    m.def("rollout", &rollout, "program"_a, "q"_a, "v"_a, "options"_a, "threads"_a);
}

}  // namespace pn
