// Numbers of a program that may differ between the runs of a batch.
#pragma once

#include <string>
#include <vector>

#include "dynamics/program.hpp"

namespace pn {

// Name of a number: call of the builder that made its owner, index of this call, and argument. A "body" is named by its
// joint, with "mass", "com" and the columns "inertia x", "inertia y" and "inertia z". "gravity" has no owner.
struct NumberName {
    std::string call;
    int index;
    std::string argument;
};

// Location of the numbers with a name: `size` numbers from `at`. find_number throws std::invalid_argument if a run
// cannot set them.
struct NumberLocation {
    double* at;
    int size;
};
NumberLocation find_number(Program& p, const NumberName& name);

}  // namespace pn
