// Numbers of a program that may differ between the runs of a batch.
#pragma once

#include <string>
#include <vector>

#include "dynamics/program.hpp"

namespace pn {

// Name of a number: call of the builder that added the law, force, contact or actuation with this number, index of this
// call, and argument. The call "body" has the index of a joint and the arguments "mass", "com" and the columns "inertia
// x", "inertia y" and "inertia z". The call "gravity" needs no index.
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
