// A program in the making: Python gives plain numbers and functions, and asks for what is finished.
#pragma once

#include <memory>
#include <string>

#include "dynamics/program.hpp"
#include "python/arrays.hpp"

namespace pn {

// A scene on its way into the core: Python adds constraints, laws and forces, and finishes the program.
struct Builder {
    std::shared_ptr<Program> p = std::make_shared<Program>();

    Builder(nb::object model, Provider terms);
    // Return the index of the new block or law. Directions of friction follow all constraints.
    int add(const std::string& name, Kind kind, Role role);
    int add_law(const std::string& name);
    // The contact that was added last may open. Those that may follow all that are kept.
    void let_open(double restitution);
    // Rows of contacts in the order of these blocks.
    void order_contacts(const std::vector<int>& blocks);
    // A program of its own, which nothing that is added later changes.
    std::shared_ptr<const Program> finish() const;
};

nb::class_<Builder> bind_builder(nb::module_& m);

}  // namespace pn
