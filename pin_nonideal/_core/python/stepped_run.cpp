#include "python/stepped_run.hpp"

#include <limits>
#include <memory>
#include <utility>

#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "python/buffers.hpp"
#include "python/reused_workspace.hpp"
#include "run/stepped_run.hpp"
#include "tree/lie_group.hpp"

using namespace nanobind::literals;

namespace pn {

namespace {

// Planned number of periods of a stepper's run, and number of samples at events after which the samples are cleared.
constexpr double planned_periods = 1e6;
constexpr size_t max_event_samples = 100;
constexpr double no_sample_interval = 1e300;  // the time to the next sample [s]

Options options_of(const std::string& method, double period, double dt, double rtol, const Array& atol) {
    Options options;
    options.method = method_named(method);
    options.duration = planned_periods * period;
    options.dt = options.method.adaptive() ? 0.0 : dt;
    options.output_dt = no_sample_interval;
    options.rtol = rtol;
    options.atol = map(atol);
    options.max_steps = std::numeric_limits<long>::max();
    return options;
}

// Run with its options, workspace and results.
struct SteppedRunOwner {
    std::shared_ptr<const Program> p;
    double period;
    Options options;
    Workspace w;
    const RunState first;
    Recording out;
    std::unique_ptr<SteppedRun> run;
    VecX q, v, tau;
    NumpyCopies q_out, v_out;

    SteppedRunOwner(std::shared_ptr<const Program> program, const std::string& method, double period_, double dt,
                    double rtol, const Array& atol)
        : p(std::move(program)), period(period_), options(options_of(method, period, dt, rtol, atol)),
          w(*p), first(w.state), q(p->mechanism.nq), v(p->mechanism.nv), tau(p->mechanism.nv),
          q_out(q.size()), v_out(v.size()) {}

    void read(nb::handle q_in, nb::handle v_in, double t, nb::handle torque) {
        read_buffer(q_in, q);
        if (!has_unit_lengths(p->mechanism, q.data(), unit_tolerance))
            throw std::invalid_argument("q holds a part that is not of unit length");
        read_buffer(v_in, v);
        if (!std::isfinite(t)) throw std::invalid_argument("expected a finite time");
        if (!torque.is_none()) read_buffer(torque, tau);
        options.t0 = t;
        reset_workspace(*p, w, first);
        w.now.has_override = !torque.is_none();
        if (w.now.has_override) w.now.override_torque = tau;
        clear_samples();
        out.events.clear();
    }

    void start(bool only) {
        if (!run) run = std::make_unique<SteppedRun>(*p, w, options, out);
        run->begin(q, v, period, only);
    }

    void begin(nb::handle q_in, nb::handle v_in, double t, nb::handle torque) {
        read(q_in, v_in, t, torque);
        attempt([&] { start(false); });
    }

    void advance(nb::handle torque) {
        if (!torque.is_none()) read_buffer(torque, tau);
        if (out.t.size() > max_event_samples) clear_samples();
        attempt([&] {
            if (!torque.is_none()) run->set_torque(tau);
            run->advance(period);
        });
    }

    // Call `act` without the GIL. If `act` throws, discard the run, because a stopped run cannot continue.
    template <class Act>
    void attempt(const Act& act) {
        try {
            nb::gil_scoped_release release;
            act();
        } catch (...) {
            run.reset();
            throw;
        }
    }

    void clear_samples() {
        for (std::vector<double>* samples : {&out.t, &out.q, &out.v, &out.violation, &out.violation_rate, &out.z})
            samples->clear();
        out.modes.clear();
        out.closed.clear();
    }

    nb::tuple state() {
        const double* y = run->state().data();
        return nb::make_tuple(q_out(y), v_out(y + q.size()));
    }

    nb::tuple step(nb::handle q_in, nb::handle v_in, double t, nb::handle torque) {
        read(q_in, v_in, t, torque);
        attempt([&] {
            start(true);
            run->advance(period);
        });
        return state();
    }
};

}  // namespace

void bind_stepped(nb::module_& m) {
    nb::class_<SteppedRunOwner>(m, "SteppedRun")
        .def(nb::init<std::shared_ptr<const Program>, const std::string&, double, double, double, const Array&>(),
             "program"_a, "method"_a, "period"_a, "dt"_a, "rtol"_a, "atol"_a)
        .def("begin", &SteppedRunOwner::begin, "q"_a, "v"_a, "t"_a, "tau"_a.none())
        .def("advance", &SteppedRunOwner::advance, "tau"_a.none())
        .def("step", &SteppedRunOwner::step, "q"_a, "v"_a, "t"_a, "tau"_a.none(),
             nb::sig("def step(self, q: object, v: object, t: float, tau: object | None) -> "
                     "tuple[NDArray[numpy.float64], NDArray[numpy.float64]]"))
        .def("state", &SteppedRunOwner::state,
             nb::sig("def state(self) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64]]"))
        .def_prop_ro("begun", [](const SteppedRunOwner& s) { return s.run != nullptr; })
        .def_prop_ro("t", [](const SteppedRunOwner& s) { return s.run->time(); })
        .def_prop_ro("modes", [](const SteppedRunOwner& s) { return static_cast<const std::vector<Mode>&>(s.w.state.mode); })
        .def("take_events", [](SteppedRunOwner& s) { return std::exchange(s.out.events, {}); });
}

}  // namespace pn
