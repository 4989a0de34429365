// The pinocchio model behind a Python object of type pinocchio.Model.
#pragma once

struct _object;

namespace pn {

// Address of the `pinocchio::Model` that the Python object holds; throws std::invalid_argument for anything else.
const void* model_pointer(_object* python_object);

// Whether two of them are the same in all that a scene reads: tree, joints, inertias, frames, gravity, armature and
// limits. What is told by name only (reference configurations) is left out, and so is what follows from the tree; that is
// four times as fast as Pinocchio's own comparison.
bool same_model(const void* one, const void* other);

}  // namespace pn
