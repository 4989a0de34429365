// Joint coordinates, in which constraints on joints are written.
#pragma once

#include <cmath>

#include "tree/terms.hpp"

namespace pn {

template <class Q>
auto joint_angle(const Joint& j, const Q& q) {
    using std::atan2;
    return j.unbounded ? atan2(q[j.iq + 1], q[j.iq]) : q[j.iq];
}

template <class Scalar>
Scalar wrap(const Scalar& x, double period) {
    using std::remainder;
    return period > 0.0 ? remainder(x, period) : x;
}

inline std::vector<int> all_dofs(const Mechanism& m) {
    std::vector<int> dofs(m.nv);
    for (int k = 0; k < m.nv; ++k) dofs[k] = k;
    return dofs;
}

}  // namespace pn
