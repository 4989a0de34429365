#include "python/external_run.hpp"

#include <memory>

#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "python/options.hpp"
#include "python/runner.hpp"
#include "run/external_run.hpp"

using namespace nanobind::literals;

namespace pn {

namespace {

using Tick = Function<void(double)>;                       // argument: time [s]
using Interpolant = nb::typed<nb::callable, Numbers(double)>;  // time inside a step -> state

Options with_events(Options options, const std::vector<UserEventTuple>& events) {
    options.events = user_events(events);
    return options;
}

// Run with its options, workspace and results.
struct ExternalRunOwner {
    std::shared_ptr<const Program> p;
    Options options;
    Workspace w;
    Recording out;
    ExternalRun run;

    ExternalRunOwner(std::shared_ptr<const Program> program, const Options& run_options, const Tick& tick,
             const std::vector<UserEventTuple>& events)
        : p(std::move(program)), options(with_events(run_options, events)), w(*p), run(*p, w, options, out) {
        if (tick) options.tick = [tick](double t) { (*tick)(t); };
    }

    Numbers derivative(double t, const Array& y) {
        VecX rate;
        run.derivative(t, map(y), rate);
        return to_numpy(rate);
    }
    Table jacobian(double t, const Array& y) {
        const MatX by_columns = run.jacobian(t, map(y));
        auto* kept = new RowMajor(by_columns);
        nb::capsule owner(kept, [](void* x) noexcept { delete static_cast<RowMajor*>(x); });
        const size_t n = y.shape(0);
        return Table(kept->data(), {n, n}, owner);
    }
    bool follow(double t, const Interpolant& interpolant) {
        return run.follow(t, [&](double at, VecX& y) {
            const Array inside = nb::cast<Array>(interpolant(at));
            y.head(inside.shape(0)) = map(inside);
        });
    }
};

}  // namespace

void bind_followed(nb::module_& m) {
    constexpr auto own = nb::rv_policy::automatic;
    nb::class_<ExternalRunOwner>(m, "ExternalRun")
        .def(nb::init<std::shared_ptr<const Program>, const Options&, const Tick&, const std::vector<UserEventTuple>&>(),
             "program"_a, "options"_a, "tick"_a = nb::none(), "events"_a = std::vector<UserEventTuple>())
        .def("start", [](ExternalRunOwner& f, const Array& q, const Array& v) { f.run.start(map(q), map(v)); }, "q"_a, "v"_a)
        .def("derivative", &ExternalRunOwner::derivative, "t"_a, "y"_a)
        .def("jacobian", &ExternalRunOwner::jacobian, "t"_a, "y"_a)
        .def("follow", &ExternalRunOwner::follow, "t"_a, "interpolant"_a)
        .def("stop_before", [](ExternalRunOwner& f, double end) { return f.run.stop_before(end); }, "end"_a)
        .def_prop_ro("t", [](const ExternalRunOwner& f) { return f.run.time(); })
        .def_prop_ro("done", [](const ExternalRunOwner& f) { return f.run.done(); })
        .def_prop_ro("y", [](const ExternalRunOwner& f) { return to_numpy(f.run.state()); }, own)
        .def_prop_ro("rate", [](const ExternalRunOwner& f) { return to_numpy(f.run.state_rate()); }, own)
        .def_prop_ro("singular_onset", [](ExternalRunOwner& f) -> std::optional<std::string> {
            const auto e = f.run.singular_onset();
            return e ? std::optional(f.p->frictions[*e].name) : std::nullopt;
        })
        .def("outcome", [](ExternalRunOwner& f) { return Outcome{f.w.counters, std::move(f.out)}; });
}

}  // namespace pn
