// Python bindings of the core: a Builder makes a program, a Runner evaluates and runs it.
#include <string>

#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "complementarity/least_norm_friction.hpp"
#include "complementarity/socp_mode_newton.hpp"
#include "python/batch.hpp"
#include "python/builder.hpp"
#include "python/callbacks.hpp"
#include "python/cones.hpp"
#include "python/constraints.hpp"
#include "python/contact_geometry.hpp"
#include "python/contact_groups.hpp"
#include "python/failures.hpp"
#include "python/external_run.hpp"
#include "python/program.hpp"
#include "python/runs.hpp"
#include "python/stepped_run.hpp"
#include "run/output/checkpoint.hpp"

using namespace pn;
using namespace nanobind::literals;

NB_MODULE(_core, m) {
    nb::set_leak_warnings(false);  // a user function can hold its own scene: a cycle, not a leak
    m.attr("pinocchio_version") = PIN_NONIDEAL_PINOCCHIO_VERSION;
    m.attr("state_layout") = state_layout() + " for Pinocchio " PIN_NONIDEAL_PINOCCHIO_VERSION;
    bind_failures(m);
    bind_reactions(m);
    nb::class_<Builder> builder = bind_builder(m);
    bind_constraints(m, builder);
    bind_contact_groups(builder);
    nb::class_<Runner> runner = bind_runner(m);
    bind_runs(m, runner);
    bind_batch(m);
    bind_followed(m);
    bind_stepped(m);
    bind_program(m);
    bind_cones(m);
    bind_contact_geometry(m);

    // Friction program on arrays, for tests against enumeration.
    m.def("friction_program", [](const Array2& W, const Array& alpha0, const std::vector<int>& dims,
                                 const Array& limits) {
        return to_numpy(friction_program(map(W), map(alpha0), dims, map(limits)));
    }, "W"_a, "alpha0"_a, "dims"_a, "limits"_a);
    // Least-norm forces of friction on arrays, for tests.
    m.def("least_norm_friction", [](const Array2& W, const std::vector<int>& dims, const Array& sizes,
                                    const Array& middles, const Array& force) {
        FrictionLimits limits;
        limits.size = map(sizes);
        limits.middle = map(middles);
        VecX shared = map(force);
        const bool found = LeastNormFriction().solve(map(W), dims, limits, shared);
        return std::pair(found, to_numpy(shared));
    }, "W"_a, "dims"_a, "sizes"_a, "middles"_a, "force"_a);
}
