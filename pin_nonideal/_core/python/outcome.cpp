#include "python/outcome.hpp"

#include <algorithm>
#include <cmath>

#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "python/failures.hpp"

namespace pn {

namespace {

// Return the exception that stopped a run (failure of the core, or exception of a user function), or None.
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

// Return recorded numbers as an array that keeps their run alive. The array is empty if they were not recorded.
template <class Number>
auto shown(std::vector<Number>& numbers, nb::handle run) {
    numbers.reserve(1);  // an empty array needs an address too
    return nb::ndarray<nb::numpy, Number, nb::ndim<1>>(numbers.data(), {numbers.size()}, run);
}
template <auto field>
auto recorded(nb::handle_t<Outcome> run) {
    return shown(nb::cast<Outcome&>(run).recording.*field, run);
}
template <auto field>
auto dense(nb::handle_t<Outcome> run) {
    return shown(nb::cast<Outcome&>(run).recording.dense.*field, run);
}

}  // namespace

void bind_outcome(nb::module_& m) {
    using R = Recording;
    nb::enum_<Event::Kind> kinds(m, "EventKind", "Kind of an event between two smooth parts of a run.");
    for (const EventKind& each : event_kinds) kinds.value(each.name, each.kind, each.meaning);
    nb::class_<Event>(m, "Event")
        .def_ro("time", &Event::time)
        .def_ro("kind", &Event::kind)
        .def_ro("element", &Event::element)
        .def_ro("energy_change", &Event::energy_change)
        .def_ro("miss", &Event::miss)
        .def_prop_ro("impulse", [](const Event& e) { return to_numpy(VecX(e.impulse.eigen())); },
                     nb::rv_policy::automatic)
        .def_prop_ro("v_minus", [](const Event& e) { return to_numpy(e.v_minus); }, nb::rv_policy::automatic)
        .def_prop_ro("v_plus", [](const Event& e) { return to_numpy(e.v_plus); }, nb::rv_policy::automatic)
        .def_prop_ro("of_contact", [](const Event& e) { return Event::of_contact(e.kind); });
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
        .def_prop_ro("tau", recorded<&R::tau>)
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
        .def_prop_ro("contact_forces", recorded<&R::contact_forces>)
        .def_prop_ro("modes", recorded<&R::modes>)
        .def_prop_ro("dense_times", dense<&DenseOutput::times>)
        .def_prop_ro("dense_states", dense<&DenseOutput::states>)
        .def_prop_ro("dense_modes", dense<&DenseOutput::modes>)
        .def_prop_ro("dense_closed", dense<&DenseOutput::closed>)
        .def_prop_ro("dense_turning", dense<&DenseOutput::turning>)
        .def_prop_ro("dense_turning_counts", dense<&DenseOutput::turning_counts>)
        .def_prop_ro("dense_directions", dense<&DenseOutput::directions>)
        .def_prop_ro("dense_sought", dense<&DenseOutput::sought>)
        .def_prop_ro("dense_torque", dense<&DenseOutput::torque>)
        .def_prop_ro("dense_moved", dense<&DenseOutput::moved>)
        .def_prop_ro("dense_impacts", dense<&DenseOutput::impacts>)
        .def_prop_ro("closed", recorded<&R::closed>)
        .def_prop_ro("events", [](const Outcome& o) { return o.recording.events; })
        .def_prop_ro("steps", [](const Outcome& o) { return o.recording.steps; })
        .def_prop_ro("rejected", [](const Outcome& o) { return o.recording.rejected; })
        .def_prop_ro("limited", [](const Outcome& o) { return o.recording.limited; })
        .def_prop_ro("rounding", [](const Outcome& o) { return o.recording.rounding; })
        .def_prop_ro("evaluations", [](const Outcome& o) { return o.counters.evaluations; })
        .def_prop_ro("factorizations", [](const Outcome& o) { return o.counters.factorizations; })
        .def_prop_ro("projections", [](const Outcome& o) { return o.counters.projections; })
        .def_prop_ro("iterations", [](const Outcome& o) { return o.counters.iterations; })
        .def_prop_ro("contact_misses", [](const Outcome& o) {
            return std::make_tuple(o.counters.signorini, o.counters.coulomb, o.counters.dissipation);
        })
        .def_prop_ro("motion_residual", [](const Outcome& o) { return o.counters.motion; })
        .def_prop_ro("stopped", stopped, nb::for_getter(nb::sig("def stopped(self) -> BaseException | None")));
}

}  // namespace pn
