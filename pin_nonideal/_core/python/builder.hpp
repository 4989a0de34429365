// Builder of a program. Python passes plain numbers and functions, and receives the finished program.
#pragma once

#include <memory>
#include <string>

#include "dynamics/program.hpp"
#include "python/arrays.hpp"

namespace pn {

// Scene under construction: Python adds constraints, laws and forces, and finishes the program.
class Builder {
public:
    Builder(nb::object model, Provider terms);
    const Program& program() const { return *program_; }
    // Return the program to change it. A finished program stays as it is, and the changes go to a copy.
    Program& edit();
    // Return the index of the new block or law. Directions of friction follow all constraints.
    int add(const std::string& name, Kind kind, Role role);
    int add_law(const std::string& name);
    // Make the contact that was added last unilateral. Unilateral contacts follow all bilateral contacts.
    void set_unilateral(double restitution);
    // Order the rows of contacts like these blocks. `pairs`: pair of convex shapes of each block, -1 if none.
    void order_contacts(const std::vector<int>& blocks, const std::vector<int>& pairs);
    // Return the finished program, which later changes do not affect. Each change may follow a finished program.
    std::shared_ptr<const Program> finish();

private:
    std::shared_ptr<Program> program_ = std::make_shared<Program>();
    bool is_finished_ = false;
};

nb::class_<Builder> bind_builder(nb::module_& m);

}  // namespace pn
