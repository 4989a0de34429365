#include "tree/model_extraction.hpp"

#include <algorithm>
#include <cstring>
#include <stdexcept>

#include <boost/python.hpp>
#include <pinocchio/multibody.hpp>

namespace pn {

namespace {

using pinocchio::Model;

// By their bits: a limit that is no number is the same as itself.
bool same(const double* x, const double* y, size_t n) { return std::memcmp(x, y, n * sizeof(double)) == 0; }

template <class Numbers>
bool same(const Eigen::MatrixBase<Numbers>& x, const Eigen::MatrixBase<Numbers>& y) {
    return x.size() == y.size() && same(x.derived().data(), y.derived().data(), x.size());
}

bool same(const Model::SE3& X, const Model::SE3& Y) {
    return same(X.translation(), Y.translation()) && same(X.rotation(), Y.rotation());
}

bool same(const Model::Inertia& X, const Model::Inertia& Y) {
    return X.mass() == Y.mass() && same(X.lever(), Y.lever()) && same(X.inertia().data(), Y.inertia().data());
}

bool same(const Model::Frame& X, const Model::Frame& Y) {
    return X.parentJoint == Y.parentJoint && same(X.placement, Y.placement) && X.name == Y.name;
}

template <class T>
bool all_same(const T& x, const T& y) {
    return std::equal(x.begin(), x.end(), y.begin(), y.end(), [](const auto& a, const auto& b) { return same(a, b); });
}

}  // namespace

bool same_model(const void* one, const void* other) {
    const Model &a = *static_cast<const Model*>(one), &b = *static_cast<const Model*>(other);
    return a.njoints == b.njoints && a.parents == b.parents && a.names == b.names && a.joints == b.joints &&
           a.gravity == b.gravity && all_same(a.jointPlacements, b.jointPlacements) &&
           all_same(a.inertias, b.inertias) && all_same(a.frames, b.frames) && same(a.armature, b.armature) &&
           same(a.lowerPositionLimit, b.lowerPositionLimit) && same(a.upperPositionLimit, b.upperPositionLimit) &&
           same(a.lowerEffortLimit, b.lowerEffortLimit) && same(a.upperEffortLimit, b.upperEffortLimit) &&
           same(a.lowerVelocityLimit, b.lowerVelocityLimit) && same(a.upperVelocityLimit, b.upperVelocityLimit);
}

const void* model_pointer(_object* python_object) {
    boost::python::extract<const pinocchio::Model&> model(python_object);
    if (!model.check()) throw std::invalid_argument("expected a pinocchio.Model");
    return &model();
}

}  // namespace pn
