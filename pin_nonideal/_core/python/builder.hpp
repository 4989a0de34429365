// Builder of a program. Python passes plain numbers and functions, and receives the finished program.
#pragma once

#include <memory>
#include <string>

#include "dynamics/program.hpp"
#include "python/arrays.hpp"

namespace pn {

// Scene under construction: Python adds constraints, laws and forces, and finishes the program.
struct Builder {
    std::shared_ptr<Program> p = std::make_shared<Program>();

    Builder(nb::object model, Provider terms);
    // Return the index of the new block or law. Directions of friction follow all constraints.
    int add(const std::string& name, Kind kind, Role role);
    int add_law(const std::string& name);
    // Make the contact that was added last unilateral. Unilateral contacts follow all bilateral contacts.
    void set_unilateral(double restitution);
    // Order the rows of contacts like these blocks. `pairs`: pair of convex shapes of each block, -1 if none.
    void order_contacts(const std::vector<int>& blocks, const std::vector<int>& pairs);
    // Return an independent program, which later additions do not change.
    std::shared_ptr<const Program> finish() const;
};

nb::class_<Builder> bind_builder(nb::module_& m);

}  // namespace pn
