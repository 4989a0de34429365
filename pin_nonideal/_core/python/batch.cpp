#include "python/batch.hpp"

#include <cmath>
#include <memory>

#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "python/cleared.hpp"
#include "python/failures.hpp"
#include "python/options.hpp"
#include "python/run_programs.hpp"
#include "python/share_out.hpp"
#include "run/stepped_run.hpp"

using namespace nanobind::literals;

namespace pn {

namespace {

// What is kept of a run: times, configurations and velocities of its samples, one after the other.
struct Kept {
    std::vector<double> t, q, v;
    double violation = 0.0;
    long steps = 0;
    std::optional<Failure> failure;
    std::exception_ptr error;
};

void keep(Recording& run, Kept& kept) {
    kept.t.assign(run.t.begin(), run.t.end());
    kept.q.assign(run.q.begin(), run.q.end());
    kept.v.assign(run.v.begin(), run.v.end());
    for (const double gap : run.violation) kept.violation = std::fmax(kept.violation, gap);
    kept.steps = run.steps;
    kept.failure = run.failure;
    kept.error = run.error;
}

// Samples of all runs, by run and sample, n numbers each; not a number beyond the last of a run.
Numbers padded(const std::vector<Kept>& runs, std::vector<double> Kept::* field, size_t samples, size_t n) {
    std::vector<double> all(runs.size() * samples * n, NAN);
    for (size_t i = 0; i < runs.size(); ++i) {
        const std::vector<double>& own = runs[i].*field;
        std::copy(own.begin(), own.end(), all.begin() + i * samples * n);
    }
    return to_numpy(std::move(all));
}

nb::object what_stopped(const Kept& run) {
    if (run.failure) return failure_object(*run.failure);
    try {
        std::rethrow_exception(run.error);
    } catch (nb::python_error& e) {
        return nb::borrow(e.value());
    } catch (const std::exception& e) {
        return nb::handle(PyExc_RuntimeError)(e.what());
    }
}

// One thread's room: a workspace with the state of a new one, and the run that works in it, used again and again.
struct Room {
    std::unique_ptr<SteppedRun> run;
    std::unique_ptr<Workspace> own;
    RunState first;
    Recording out;

    void carry(const Program& p, const Options& options, bool anew, const VecX& q0, const VecX& v0) {
        if (!run || anew) {
            run.reset();
            own = std::make_unique<Workspace>(p);
            first = own->state;
            run = std::make_unique<SteppedRun>(p, *own, options, out);
        } else {
            clear(p, *own, first);
        }
        forget();
        try {
            run->begin(q0, v0, options.duration);
            run->run();
        } catch (const Failure& failure) {
            out.failure = failure;
        } catch (...) {
            out.error = std::current_exception();
        }
        if (out.failure || out.error) run.reset();
    }

    void forget() {
        for (std::vector<double>* samples : {&out.t, &out.q, &out.v, &out.violation, &out.violation_rate, &out.z})
            samples->clear();
        out.modes.clear();
        out.closed.clear();
        out.events.clear();
        out.steps = out.rejected = out.limited = 0;
        out.rounding = 0.0;
        out.failure.reset();
        out.error = nullptr;
    }
};

std::vector<Kept> run_all(const Program& p, const Array2& q, const Array2& v, Options options, int threads,
                          const std::vector<NumberTuple>& names, const Array2& values) {
    const size_t count = q.shape(0);
    const int useful = useful_threads(count, threads);
    RunPrograms programs(p, names, values, useful);
    std::vector<Kept> runs(count);
    std::vector<Room> rooms(useful);
    std::atomic<bool> stopped{false};
    options.tick = [&stopped](double t) {
        if (stopped) throw Failure(Failure::Kind::interrupted, t);
    };
    const auto q_all = map(q), v_all = map(v);
    share_out(count, threads, stopped, [&](size_t i, int k) {
        const Program& program = programs.of(i, k);
        rooms[k].carry(program, options, !names.empty(), q_all.row(i), v_all.row(i));
        keep(rooms[k].out, runs[i]);
    });
    return runs;
}

// t, q, v, then by run the number of samples, the largest violation and the number of steps, and what stopped which.
nb::tuple rollout_arrays(const Program& p, const Array2& q, const Array2& v, const Options& options, int threads,
                         const std::vector<NumberTuple>& names, const Array2& values) {
    const std::vector<Kept> runs = run_all(p, q, v, options, threads, names, values);
    std::vector<double> samples, violation, steps;
    size_t most = 0;
    nb::list stopped;
    for (size_t i = 0; i < runs.size(); ++i) {
        most = std::max(most, runs[i].t.size());
        samples.push_back(static_cast<double>(runs[i].t.size()));
        violation.push_back(runs[i].violation);
        steps.push_back(static_cast<double>(runs[i].steps));
        if (runs[i].failure || runs[i].error) stopped.append(nb::make_tuple(i, what_stopped(runs[i])));
    }
    const size_t nq = p.mechanism.nq, nv = p.mechanism.nv;
    return nb::make_tuple(padded(runs, &Kept::t, most, 1), padded(runs, &Kept::q, most, nq),
                          padded(runs, &Kept::v, most, nv), to_numpy(std::move(samples)),
                          to_numpy(std::move(violation)), to_numpy(std::move(steps)), stopped);
}

}  // namespace

void bind_batch(nb::module_& m) {
    m.def("rollout_arrays", &rollout_arrays, "program"_a, "q"_a, "v"_a, "options"_a, "threads"_a, "names"_a, "values"_a,
          nb::sig("def rollout_arrays(program: Program, q: NDArray[numpy.float64], v: NDArray[numpy.float64], "
                  "options: pin_nonideal.runs.options.RunOptions, threads: int, names: Sequence[tuple[str, int, str]], "
                  "values: NDArray[numpy.float64]) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64], "
                  "NDArray[numpy.float64], NDArray[numpy.float64], NDArray[numpy.float64], NDArray[numpy.float64], "
                  "list[tuple[int, BaseException]]]"));
}

}  // namespace pn
