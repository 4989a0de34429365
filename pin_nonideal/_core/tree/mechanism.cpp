#include "tree/mechanism.hpp"

namespace pn {

std::vector<int> Mechanism::dofs_of(int joint) const {
    std::vector<int> dofs;
    if (joint == 0) return dofs;
    for (int d = joints[joint].iv + joints[joint].nv - 1; d >= 0; d = dof_parent[d]) dofs.push_back(d);
    return dofs;
}

}  // namespace pn
