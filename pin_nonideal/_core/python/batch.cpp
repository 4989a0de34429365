#include "python/batch.hpp"

#include <algorithm>
#include <cmath>
#include <memory>

#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "python/failures.hpp"
#include "python/reused_run.hpp"
#include "python/options.hpp"
#include "python/run_programs.hpp"
#include "python/thread_pool.hpp"

using namespace nanobind::literals;

namespace pn {

namespace {

// Results of consecutive runs: times, configurations and velocities of their samples, concatenated. Per run also the
// number of samples, the largest violation and the number of steps.
struct RunSamples {
    std::vector<double> t, q, v, samples, violation, steps;
    struct Stop {
        size_t run;
        std::optional<Failure> failure;
        std::exception_ptr error;
    };
    std::vector<Stop> stopped;

    void add(size_t i, const Recording& run) {
        t.insert(t.end(), run.t.begin(), run.t.end());
        q.insert(q.end(), run.q.begin(), run.q.end());
        v.insert(v.end(), run.v.begin(), run.v.end());
        samples.push_back(static_cast<double>(run.t.size()));
        double largest = 0.0;
        for (const double gap : run.violation) largest = std::fmax(largest, gap);
        violation.push_back(largest);
        steps.push_back(static_cast<double>(run.steps));
        if (run.failure || run.error) stopped.push_back({i, run.failure, run.error});
    }
};

// Array of all samples, n numbers each, by run and sample. Threads write it, because the page faults of a large array
// take longer than the copy.
struct PaddedArray {
    std::vector<double> RunSamples::* field;
    size_t n, max_samples;
    double* to;
    Numbers numbers;

    PaddedArray(std::vector<double> RunSamples::* field, size_t n, size_t runs, size_t max_samples)
        : field(field), n(n), max_samples(max_samples), to(new double[std::max<size_t>(1, runs * max_samples * n)]) {
        const nb::capsule owner(to, [](void* data) noexcept { delete[] static_cast<double*>(data); });
        numbers = Numbers(to, {runs * max_samples * n}, owner);
    }
    // Write runs from number `first` on, with NaN after the last sample of a run.
    void copy(const RunSamples& some, size_t first) const {
        const double* from = (some.*field).data();
        double* at = to + first * max_samples * n;
        for (const double samples : some.samples) {
            const size_t own = static_cast<size_t>(samples) * n;
            std::fill(std::copy_n(from, own, at), at + max_samples * n, NAN);
            from += own;
            at += max_samples * n;
        }
    }
};

// Return one number per run.
Numbers joined(const std::vector<RunSamples>& all, std::vector<double> RunSamples::* field) {
    std::vector<double> out;
    for (const RunSamples& some : all) out.insert(out.end(), (some.*field).begin(), (some.*field).end());
    return to_numpy(std::move(out));
}

nb::object stop_reason(const RunSamples::Stop& run) {
    if (run.failure) return failure_object(*run.failure);
    try {
        std::rethrow_exception(run.error);
    } catch (nb::python_error& e) {
        return nb::borrow(e.value());
    } catch (const std::exception& e) {
        return nb::handle(PyExc_RuntimeError)(e.what());
    }
}

// Number of blocks of consecutive runs per thread. Neighbors in memory then belong to one thread, and the threads end
// at about the same time.
constexpr size_t draws = 32;

std::vector<RunSamples> run_all(const Program& p, const Array2& q, const Array2& v, Options options, int threads,
                                const std::vector<NumberTuple>& names, const Array2& values) {
    const size_t count = q.shape(0);
    const int useful = useful_threads(count, threads);
    const size_t parts = std::min(count, draws * static_cast<size_t>(useful));
    RunPrograms programs(p, names, values, useful);
    std::vector<RunSamples> kept(parts);
    std::vector<ThreadWorkspace> workspaces(useful);
    std::atomic<bool> stopped{false};
    options.tick = [&stopped](double t) {
        if (stopped) throw EndOfRun{Failure(Failure::Kind::interrupted, t)};
    };
    const auto q_all = map(q), v_all = map(v);
    parallel_for(parts, threads, stopped, [&](size_t part, int k) {
        RunSamples mine;
        for (size_t i = part * count / parts; i < (part + 1) * count / parts && !stopped; ++i) {
            const Program& program = programs.of(i, k);
            workspaces[k].run_from(program, options, !names.empty(), q_all.row(i), v_all.row(i));
            mine.add(i, workspaces[k].run.out);
        }
        kept[part] = std::move(mine);
    });
    return kept;
}

// Return t, q and v, then per run the number of samples, the largest violation and the number of steps. The last item
// is a list of the stopped runs with their exceptions.
nb::tuple rollout_arrays(const Program& p, const Array2& q, const Array2& v, const Options& options, int threads,
                         const std::vector<NumberTuple>& names, const Array2& values) {
    std::vector<RunSamples> all = run_all(p, q, v, options, threads, names, values);
    size_t max_samples = 0;
    nb::list stopped;
    std::vector<size_t> first{0};
    for (const RunSamples& some : all) {
        for (const double samples : some.samples) max_samples = std::max(max_samples, static_cast<size_t>(samples));
        for (const RunSamples::Stop& each : some.stopped) stopped.append(nb::make_tuple(each.run, stop_reason(each)));
        first.push_back(first.back() + some.samples.size());
    }
    const size_t runs = q.shape(0), nq = p.mechanism.nq, nv = p.mechanism.nv;
    const PaddedArray padded[] = {{&RunSamples::t, 1, runs, max_samples},
                                  {&RunSamples::q, nq, runs, max_samples},
                                  {&RunSamples::v, nv, runs, max_samples}};
    std::atomic<bool> interrupted{false};
    parallel_for(all.size(), threads, interrupted, [&](size_t part, int) {
        for (const PaddedArray& each : padded) {
            each.copy(all[part], first[part]);
            (all[part].*each.field) = {};
        }
    });
    return nb::make_tuple(padded[0].numbers, padded[1].numbers, padded[2].numbers, joined(all, &RunSamples::samples),
                          joined(all, &RunSamples::violation), joined(all, &RunSamples::steps), stopped);
}

}  // namespace

void bind_batch(nb::module_& m) {
    m.def("rollout_arrays", &rollout_arrays, "program"_a, "q"_a, "v"_a, "options"_a, "threads"_a, "names"_a, "values"_a,
          nb::sig("def rollout_arrays(program: Program, q: NDArray[numpy.float64], v: NDArray[numpy.float64], "
                  "options: pin_nonideal.simulation.options.RunOptions, threads: int, "
                  "names: Sequence[tuple[str, int, str]], values: NDArray[numpy.float64]) "
                  "-> tuple[NDArray[numpy.float64], NDArray[numpy.float64], "
                  "NDArray[numpy.float64], NDArray[numpy.float64], NDArray[numpy.float64], NDArray[numpy.float64], "
                  "list[tuple[int, BaseException]]]"));
}

}  // namespace pn
