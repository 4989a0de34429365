#include "tree/model_extraction.hpp"

#include <stdexcept>

#include <boost/python.hpp>
#include <pinocchio/multibody.hpp>

namespace pn {

const void* model_pointer(_object* python_object) {
    boost::python::extract<const pinocchio::Model&> model(python_object);
    if (!model.check()) throw std::invalid_argument("expected a pinocchio.Model");
    return &model();
}

}  // namespace pn
