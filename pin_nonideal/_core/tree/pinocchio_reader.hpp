// Pinocchio models from Python: access to the C++ object, conversion to a Mechanism, comparison.
#pragma once

#include "tree/mechanism.hpp"

struct _object;

namespace pn {

// Address of the `pinocchio::Model` that the Python object holds; throws std::invalid_argument for anything else.
const void* model_pointer(_object* python_object);

// Whether two of them are the same in all that a scene reads: tree, joints, inertias, frames, gravity, armature and
// limits. What is told by name only (reference configurations) is left out, and so is what follows from the tree; that is
// four times as fast as Pinocchio's own comparison.
bool same_model(const void* one, const void* other);

// Reads a pinocchio model (passed as `const pinocchio::Model*`); throws std::invalid_argument for one that has no
// motion here, or none that `provider` computes.
Mechanism read_mechanism(const void* model, Provider provider);

}  // namespace pn
