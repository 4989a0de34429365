// Runs: options and states in, recordings out.
#include "python/bindings.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <condition_variable>
#include <mutex>
#include <system_error>
#include <thread>

#include <nanobind/stl/string.h>

#include "constraints/projection.hpp"

namespace pn {

namespace {

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

RecordOptions read_record(const nb::dict& d) {
    const auto wanted = [&](const char* key) { return nb::cast<bool>(d[key]); };
    return {wanted("a"), wanted("forces"), wanted("energy"), wanted("power")};
}

nb::dict Outcome::hand_over() {
    nb::dict out;
    Recording& r = recording;
    const std::pair<const char*, std::vector<double>*> fields[] = {
        {"t", &r.t}, {"q", &r.q}, {"v", &r.v}, {"violation", &r.violation}, {"violation_rate", &r.violation_rate},
        {"a", &r.a}, {"F_ideal", &r.F_ideal}, {"F_nonideal", &r.F_nonideal}, {"lam", &r.lam},
        {"lam_ideal", &r.lam_ideal}, {"energy", &r.energy}, {"power", &r.power}, {"z", &r.z}};
    double largest_violation = 0.0;
    for (const double gap : r.violation) largest_violation = std::fmax(largest_violation, gap);
    for (const auto& [name, values] : fields)
        if (!values->empty()) out[name] = to_numpy(std::move(*values));
    if (!r.modes.empty()) out["modes"] = to_numpy(std::vector<double>(r.modes.begin(), r.modes.end()));
    nb::list events;
    for (const Event& e : r.events) events.append(nb::make_tuple(e.time, static_cast<int>(e.kind), e.element));
    out["events"] = events;
    out["largest_violation"] = largest_violation;
    out["counters"] = nb::make_tuple(r.steps, r.rejected, counters.evaluations, counters.factorizations,
                                     counters.projections, counters.iterations);
    out["failure"] = r.failure ? failure_object(*r.failure) : nb::none();
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

nb::dict Runner::simulate(const Array& q_in, const Array& v_in, const Array& z, const nb::dict& options) {
    const Options o = read_options(options);
    const VecX q0 = map(q_in), v0 = map(v_in);
    w->state.z = map(z);
    w->now.has_override = false;
    Recording recording;
    {
        nb::gil_scoped_release release;
        pn::simulate(*p, *w, q0, v0, o, recording);
    }
    return Outcome{w->counters, std::move(recording)}.hand_over();
}

nb::dict Runner::resume(const nb::bytes& state, const nb::dict& options) {
    const Options o = read_options(options);
    const std::string bytes(static_cast<const char*>(state.data()), state.size());
    Recording recording;
    w = std::make_unique<Workspace>(*p);
    {
        nb::gil_scoped_release release;
        pn::resume(*p, *w, bytes, o, recording);
    }
    return Outcome{w->counters, std::move(recording)}.hand_over();
}

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

nb::tuple nearest_states(const Builder& b, const Array2& q_in, const Array2& v_in, double t, double far, int threads) {
    RowMajor q = map(q_in), v = map(v_in);
    VecX after = VecX::Constant(q.rows(), NAN), rate = after;
    std::vector<std::unique_ptr<Workspace>> spaces(useful_threads(q.rows(), threads));
    std::atomic<bool> stopped{false};
    share_out(q.rows(), threads, stopped, [&](size_t i, int k) {
        if (!spaces[k]) spaces[k] = std::make_unique<Workspace>(*b.p);
        VecX q_one = q.row(i), v_one = v.row(i);
        try {
            const Closure found = close(*b.p, *spaces[k], t, q_one, v_one, far);
            after[i] = found.after;
            rate[i] = found.rate;
            q.row(i) = q_one;
            v.row(i) = v_one;
        } catch (...) {
            // Told where the state is taken alone.
        }
    });
    return nb::make_tuple(to_numpy(q.data(), q.size()), to_numpy(v.data(), v.size()), to_numpy(after), to_numpy(rate));
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

// Every run has a workspace of its own.
nb::list rollout(const Builder& b, const Array2& q, const Array2& v, const Array& z, const nb::dict& options,
                 int threads) {
    const size_t count = q.shape(0);
    std::vector<std::optional<Outcome>> outcomes(count);
    std::atomic<bool> stopped{false};
    const auto stop = [&stopped](double t) {
        if (stopped) throw Failure(Failure::Kind::interrupted, t);
    };
    // Read here and not in the threads: options hold Python's objects, whose counts need the lock.
    Options own = read_options(options), others = own;
    others.tick = stop;  // Python tells its signals to the caller's thread
    own.tick = [stop, signals = own.tick](double t) {
        stop(t);
        signals(t);
    };
    const VecX z0 = map(z);
    const auto q_all = map(q), v_all = map(v);
    try {
        share_out(count, threads, stopped, [&](size_t i, int k) {
            Workspace space(*b.p);
            space.state.z = z0;
            Recording mine;  // neighbors in one array would share lines of cache between the threads
            simulate(*b.p, space, q_all.row(i), v_all.row(i), k == 0 ? own : others, mine);
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
    nb::list out;
    for (std::optional<Outcome>& one : outcomes) out.append(one ? nb::cast(std::move(*one)) : nb::none());
    return out;
}

}  // namespace pn
