// Conversion of Python's RunOptions to core options.
#pragma once

#include <string>

#include "python/arrays.hpp"
#include "run/whole_run.hpp"

namespace pn {

inline bool any_object(PyObject*) { return true; }
// RunOptions object of Python, converted later.
class RunOptions : public nb::object {
    NB_OBJECT_DEFAULT(RunOptions, nb::object, "pin_nonideal.simulation.options.RunOptions", any_object)
};

// User event: function t, q, v -> number, direction of the crossings that count, and number of events that ends the
// run.
using OfInstant = nb::typed<nb::callable, double(double, Numbers, Numbers)>;
using UserEventTuple = std::tuple<OfInstant, int, long>;
std::vector<UserEvent> user_events(const std::vector<UserEventTuple>& given);
// Callback between steps: t, q, v -> True to stop, torques, or None.
using Callback = Function<nb::object(double, Numbers, Numbers)>;
decltype(Options::callback) user_callback(const Callback& given);

}  // namespace pn

namespace nanobind::detail {

// Type caster of Python's RunOptions. No other code reads its fields.
template <>
struct type_caster<pn::Options> {
    NB_TYPE_CASTER(pn::Options, const_name("pin_nonideal.simulation.options.RunOptions"))

    bool from_python(handle from, uint32_t, cleanup_list*) noexcept {
        try {
            const auto number = [&](const char* key) { return nanobind::cast<double>(from.attr(key)); };
            const auto flag = [&](const char* key) { return nanobind::cast<bool>(from.attr(key)); };
            value.method = pn::method_named(nanobind::cast<std::string>(from.attr("method")));
            value.t0 = number("t0");
            value.duration = number("duration");
            value.rtol = number("rtol");
            value.dt = number("dt");
            value.output_dt = number("output_dt");
            value.max_wall = number("max_wall");
            value.max_steps = nanobind::cast<long>(from.attr("max_steps"));
            pn::read_into(from.attr("atol"), value.atol);
            value.record = {flag("a"), flag("forces"), flag("energy"), flag("power"),
                            flag("laws"), flag("reactions"), flag("tau"), flag("dense")};
            value.continues = nanobind::cast<std::string>(from.attr("several")) == "continue";
            value.strict = flag("strict");
            return true;
        } catch (const std::exception&) {
            return false;
        }
    }
};

}  // namespace nanobind::detail
