// Pinocchio models from Python: access to the C++ object, conversion to a Mechanism, comparison.
#pragma once

#include "tree/mechanism.hpp"

struct _object;

namespace pn {

// Return the address of the `pinocchio::Model` in a Python object. Throw std::invalid_argument for any other object.
const void* model_pointer(_object* python_object);

// Check if two models are equal in all data that a scene reads: tree, joints, inertias, frames, gravity, armature and
// limits. Reference configurations and quantities derived from the tree are not compared. The check is four times as
// fast as Pinocchio's own comparison.
bool same_model(const void* one, const void* other);

// Read a Pinocchio model (passed as `const pinocchio::Model*`). Throw std::invalid_argument for an unsupported joint,
// or for joint numbers that Provider::pinocchio does not support.
Mechanism read_mechanism(const void* model, Provider provider);

}  // namespace pn
