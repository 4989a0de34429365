#include "python/failures.hpp"

#include <nanobind/stl/vector.h>

#include "python/arrays.hpp"

namespace pn {

static PyObject* core_failure = nullptr;  // type of the exception, alive as long as the module

static nb::list arrays(const std::vector<VecX>& all) {
    nb::list list;
    for (const VecX& x : all) list.append(to_numpy(x));
    return list;
}

nb::object failure_object(const Failure& failure) {
    nb::object error = nb::handle(core_failure)();
    error.attr("kind") = failure.kind;
    error.attr("time") = failure.time;
    error.attr("elements") = failure.elements;
    error.attr("value") = failure.value;
    error.attr("solutions") = failure.solutions;
    error.attr("limits") = arrays(failure.limits);
    error.attr("accelerations") = arrays(failure.accelerations);
    return error;
}

void bind_failures(nb::module_& m) {
    using Kind = Failure::Kind;
    using Solutions = Failure::Solutions;
    nb::enum_<Solutions>(m, "Solutions", "Proven number of motions under friction at a paradox.")
        .value("unproven", Solutions::unproven)
        .value("none", Solutions::none)
        .value("several", Solutions::several);
    nb::enum_<Kind>(m, "FailureKind", "Cause of the failure of an evaluation or a run.")
        .value("singular_mass", Kind::singular_mass, "elements: the degree of freedom")
        .value("inconsistent", Kind::inconsistent, "elements: blocks of rows; value: residual")
        .value("not_finite", Kind::not_finite)
        .value("impact_energy", Kind::impact_energy, "elements: blocks of the contacts; value: energy gained")
        .value("paradox", Kind::paradox, "elements: friction elements; value: determinant")
        .value("not_converged", Kind::not_converged, "elements: friction elements whose modes were not found")
        .value("closure", Kind::closure, "elements: the block of rows; value: gap")
        .value("step_size", Kind::step_size, "value: number of steps so far of a run without progress")
        .value("stiff", Kind::stiff, "elements: the degree of freedom; value: rate")
        .value("growing", Kind::growing,
               "elements: the degree of freedom, and its cause: 0 the actuation, 1 given forces, 2 laws; value: rate")
        .value("unmet_law", Kind::unmet_law,
               "elements: the law (0 motion, 1 Signorini, 2 limits, 3 dissipation), and its dof, block or friction "
               "element; value: residual")
        .value("steps", Kind::steps, "value: maximum number of steps, which the run has taken")
        .value("wall", Kind::wall, "value: maximum wall time, which the run has taken")
        .value("interrupted", Kind::interrupted);
    core_failure = PyErr_NewException("pin_nonideal._core.CoreFailure", nullptr, nullptr);
    m.attr("CoreFailure") = nb::steal(core_failure).inc_ref();
    nb::register_exception_translator([](const std::exception_ptr& thrown, void*) {
        try {
            std::rethrow_exception(thrown);
        } catch (const Failure& failure) {
            PyErr_SetObject(core_failure, failure_object(failure).ptr());
        }
    });
}

}  // namespace pn
