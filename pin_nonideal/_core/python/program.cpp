#include "python/program.hpp"

#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <numeric>
#include <tuple>

#include "dynamics/law_forces.hpp"
#include "dynamics/power.hpp"
#include "python/arrays.hpp"
#include "python/constraints.hpp"
#include "python/runner.hpp"
#include "tree/pinocchio_reader.hpp"

using namespace nanobind::literals;

namespace pn {

static std::vector<int> first_blocks(int count) {
    std::vector<int> blocks(count);
    std::iota(blocks.begin(), blocks.end(), 0);
    return blocks;
}

void bind_program(nb::module_& m) {
    nb::class_<Program>(m, "Program")
        .def("is_of", [](const Program& p, nb::handle model) {
            return same_model(p.mechanism.model.get(), model_pointer(model.ptr()));
        }, "model"_a)
        .def("constraint_rows", &constraint_rows, "blocks"_a)
        .def_prop_ro("constraints", [](const Program& p) { return constraint_rows(p, first_blocks(p.constraints)); })
        .def_prop_ro("bilateral", [](const Program& p) { return constraint_rows(p, first_blocks(p.first_gap)); })
        .def_prop_ro("block_names", &block_names)
        .def_prop_ro("first_rows", &first_rows)
        .def_prop_ro("free_gaps", &free_gaps)
        .def_prop_ro("rows", [](const Program& p) { return p.user_rows; })
        .def_prop_ro("states", [](const Program& p) { return p.states; })
        .def_prop_ro("framed_contacts", &framed_contacts)
        .def_prop_ro("contacts", [](const Program& p) { return p.all_contacts; })
        .def_prop_ro("first_gap", [](const Program& p) { return p.first_gap; })
        .def_prop_ro("law_names", [](const Program& p) { return p.law_names; })
        .def_prop_ro("power_names", &power_names)
        // Degrees of freedom of all laws in sequence, and the end index of each law in this list.
        .def("law_supports", [](const Program& p) {
            std::vector<double> dofs, ends;
            for (const std::vector<int>& support : law_supports(p)) {
                dofs.insert(dofs.end(), support.begin(), support.end());
                ends.push_back(static_cast<double>(dofs.size()));
            }
            return std::make_pair(to_numpy(std::move(dofs)), to_numpy(std::move(ends)));
        })
        .def_prop_ro("reaction_blocks", &reaction_blocks)
        .def_prop_ro("element_laws", [](const Program& p) {
            std::vector<int> laws;
            for (const Friction& f : p.frictions) laws.push_back(f.law);
            return laws;
        })
        .def_prop_ro("element_sizes", [](const Program& p) {
            std::vector<int> sizes;
            for (const Friction& f : p.frictions) sizes.push_back(f.dim);
            return sizes;
        })
        .def_prop_ro("element_names", [](const Program& p) {
            std::vector<std::string> names;
            for (const Friction& f : p.frictions) names.push_back(f.name);
            return names;
        })
        // Static limit of each element as constant + coefficient |lam| of a row; row -1 for limits of another form.
        .def_prop_ro("element_limits", [](const Program& p) {
            std::vector<std::tuple<int, double, double>> limits;
            for (const Friction& f : p.frictions) {
                const bool loaded = f.load == Friction::Load::multiplier;
                limits.emplace_back(loaded ? f.row : -1, loaded ? f.mu * f.static_ratio : 0.0,
                                    f.constant * f.static_ratio);
            }
            return limits;
        })
        .def("runner", [](std::shared_ptr<const Program> p) { return Runner(std::move(p)); });
}

}  // namespace pn
