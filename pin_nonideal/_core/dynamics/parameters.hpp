// Numbers of a program that every run of a batch may have for itself.
#pragma once

#include <string>
#include <vector>

#include "dynamics/program.hpp"

namespace pn {

// A number by its name: the call of the builder that made what it belongs to, which of these calls, and the argument.
// A "body" is named by its joint, with "mass", "com" and the columns "inertia x", "inertia y" and "inertia z"; "gravity"
// stands for itself.
struct NumberName {
    std::string call;
    int index;
    std::string argument;
};

// The numbers of that name, `size` of them from `at` on; throws std::invalid_argument where a run can have none.
struct NumberPlace {
    double* at;
    int size;
};
NumberPlace find_number(Program& p, const NumberName& name);

}  // namespace pn
