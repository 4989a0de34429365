// The pinocchio model behind a Python object of type pinocchio.Model.
#pragma once

struct _object;

namespace pn {

// Address of the `pinocchio::Model` that the Python object holds; throws std::invalid_argument for anything else.
const void* model_pointer(_object* python_object);

}  // namespace pn
