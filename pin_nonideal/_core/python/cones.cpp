#include "python/cones.hpp"

#include <nanobind/stl/optional.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "complementarity/cone/solver.hpp"

using namespace nanobind::literals;

namespace pn {

namespace {

// Cone solver on arrays. W arrives row by row from Python, and the core stores columns.
struct ConeSolver {
    ConeComplementarity solver;
    MatX W;
    VecX w0, f;
    std::vector<ConeElement> elements;

    ConeStatus solve(const Array2& rows, const Array& at_rest, const std::vector<int>& dims,
                     const std::vector<double>& bounds, int contacts, const std::optional<Array>& start) {
        W = map(rows);
        w0 = map(at_rest);
        f.setZero(w0.size());
        elements.clear();
        for (size_t e = 0; e < dims.size(); ++e)
            elements.push_back(static_cast<int>(e) < contacts ? ConeElement::contact(dims[e], bounds[e])
                                                              : ConeElement::box(dims[e], bounds[e]));
        if (start) f = map(*start);
        return solver.solve(W, w0, elements, start.has_value(), f);
    }
};

}  // namespace

void bind_cones(nb::module_& m) {
    constexpr auto own = nb::rv_policy::automatic;
    nb::enum_<ConeStatus>(m, "ConeStatus", "Result of a problem of contacts and friction.")
        .value("solved", ConeStatus::solved)
        .value("infeasible", ConeStatus::infeasible)
        .value("jammed", ConeStatus::jammed)
        .value("failed", ConeStatus::failed);
    nb::class_<ConeSolver>(m, "ConeSolver")
        .def(nb::init<>())
        .def("solve", &ConeSolver::solve, "W"_a, "w0"_a, "dims"_a, "bounds"_a, "contacts"_a, "start"_a = nb::none())
        // Repeats the last problem, for counts of allocations and steps.
        .def("again", [](ConeSolver& s, int count, bool warm) {
            for (int k = 0; k < count; ++k) s.solver.solve(s.W, s.w0, s.elements, warm, s.f);
        }, "count"_a, "warm"_a)
        .def_prop_ro("f", [](const ConeSolver& s) { return to_numpy(s.f); }, own)
        .def_prop_ro("residuals", [](const ConeSolver& s) {
            const ConeResiduals r = cone_residuals(s.W, s.w0, s.elements, s.f);
            return std::make_tuple(r.signorini, r.coulomb, r.dissipation);
        })
        .def_prop_ro("certificate", [](const ConeSolver& s) { return to_numpy(s.solver.certificate()); }, own)
        .def_prop_ro("unique_shares", [](const ConeSolver& s) { return s.solver.unique_shares(); })
        .def_prop_ro("steps", [](const ConeSolver& s) {
            return std::make_tuple(s.solver.newton_steps(), s.solver.path_steps());
        });
}

}  // namespace pn
