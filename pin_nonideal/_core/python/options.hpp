// Python's RunOptions as the core reads them.
#pragma once

#include <string>

#include "python/arrays.hpp"
#include "run/simulation.hpp"

namespace nanobind::detail {

// The one place that reads Python's RunOptions.
template <>
struct type_caster<pn::Options> {
    NB_TYPE_CASTER(pn::Options, const_name("pin_nonideal.runs.options.RunOptions"))

    bool from_python(handle from, uint32_t, cleanup_list*) noexcept {
        try {
            const auto number = [&](const char* key) { return nanobind::cast<double>(from.attr(key)); };
            const auto wanted = [&](const char* key) { return nanobind::cast<bool>(from.attr(key)); };
            value.method = pn::method_named(nanobind::cast<std::string>(from.attr("method")));
            value.t0 = number("t0");
            value.duration = number("duration");
            value.rtol = number("rtol");
            value.dt = number("dt");
            value.output_dt = number("output_dt");
            value.max_steps = nanobind::cast<long>(from.attr("max_steps"));
            pn::read_into(from.attr("atol"), value.atol);
            value.record = {wanted("a"), wanted("forces"), wanted("energy"), wanted("power"),
                            wanted("laws"), wanted("reactions")};
            value.continues = nanobind::cast<std::string>(from.attr("several")) == "continue";
            return true;
        } catch (const std::exception&) {
            return false;
        }
    }
};

}  // namespace nanobind::detail
