#include "tree/articulated.hpp"

#include <cmath>

namespace pn {

PN_WIDE int factorize_articulated(const Mechanism& m, BodyTerms& terms) {
    Articulation& deep = terms.deep;
    for (int i : m.deep_joints) deep.inertia[i] = articulated(terms.body[i].inertia);
    for (size_t n = m.deep_joints.size(); n-- > 0;) {
        const int i = m.deep_joints[n];
        const Joint& j = m.joints[i];
        ArticulatedInertia P = deep.inertia[i];
        for (int k = j.iv + j.nv - 1; k >= j.iv; --k) {
            terms.D[k] = 1.0;
            terms.inv_sqrt_D[k] = 0.0;
            if (terms.locked[k]) continue;
            const Force u = P * terms.J[k];
            const double pivot = dot(terms.J[k], u) + m.armature[k];
            terms.D[k] = pivot;
            if (!(pivot > 0.0)) return k;
            terms.inv_sqrt_D[k] = 1.0 / std::sqrt(pivot);
            deep.gain[k] = (1.0 / pivot) * u;
            release(P, u, deep.gain[k]);
        }
        if (j.parent != 0) deep.inertia[j.parent] += before(P, deep.shift[i]);
    }
    return -1;
}

// Process one dof of a sweep toward the roots. The net force moves the dof, and the rest of the force on the body goes
// to the parent.
static PN_INLINE void keep_force(const Mechanism& m, BodyTerms& terms, int dof, double& x) {
    const int i = m.dof_joint[dof];
    const Joint& j = m.joints[i];
    Force& f = terms.deep.forces[i];
    if (terms.locked[dof]) {
        x = 0.0;
    } else {
        const double left = x + dot(terms.J[dof], f);
        f -= left * terms.deep.gain[dof];
        x = left * terms.inv_sqrt_D[dof];  // Eq. (5)
    }
    if (dof == j.iv && j.parent != 0) terms.deep.forces[j.parent] += before(f, terms.deep.shift[i]);
}

PN_WIDE void solve_R_articulated(const Mechanism& m, BodyTerms& terms, const Force* body, VecX& x) {
    for (int i : m.deep_joints) terms.deep.forces[i] = body ? body[i] : Force{};
    for (size_t n = m.deep_dofs.size(); n-- > 0;) keep_force(m, terms, m.deep_dofs[n], x[m.deep_dofs[n]]);
}

PN_WIDE void scale_row_articulated(const Mechanism& m, BodyTerms& terms, const std::vector<int>& dofs, int joint1,
                                   const Force& f1, int joint2, const Force& f2, double* x, int stride) {
    for (int dof : dofs)
        if (m.is_deep[dof]) terms.deep.forces[m.dof_joint[dof]] = Force{};
    if (m.joints[joint1].deep) terms.deep.forces[joint1] += f1;
    if (m.joints[joint2].deep) terms.deep.forces[joint2] -= f2;
    for (size_t l = 0; l < dofs.size(); ++l)
        if (m.is_deep[dofs[l]]) keep_force(m, terms, dofs[l], x[l * stride]);  // Eq. (7)
}

// Return the motion of the body of a dof. At the first dof of a joint the motion starts as that of the parent body.
static PN_INLINE Motion& carried(const Mechanism& m, BodyTerms& terms, int dof) {
    const int i = m.dof_joint[dof];
    const Joint& j = m.joints[i];
    Motion& a = terms.deep.motions[i];
    if (dof == j.iv) a = j.parent == 0 ? Motion{} : further(terms.deep.motions[j.parent], terms.deep.shift[i]);
    return a;
}

PN_WIDE void solve_Rt_articulated(const Mechanism& m, BodyTerms& terms, const std::vector<int>& dofs, VecX& x) {
    for (int dof : dofs) {
        if (!m.is_deep[dof]) continue;
        Motion& a = carried(m, terms, dof);
        if (terms.locked[dof]) {
            x[dof] = 0.0;
            continue;
        }
        x[dof] = x[dof] * terms.inv_sqrt_D[dof] - dot(a, terms.deep.gain[dof]);
        a += x[dof] * terms.J[dof];
    }
}

PN_WIDE void move_articulated(const Mechanism& m, BodyTerms& terms, const VecX& x) {
    for (int dof : m.deep_dofs) carried(m, terms, dof) += x[dof] * terms.J[dof];
}

PN_WIDE void multiply_M_articulated(const Mechanism& m, BodyTerms& terms, const VecX& x, Force* body, VecX& y) {
    move_articulated(m, terms, x);
    Force* f = body ? body : terms.deep.forces.data();
    for (int i : m.deep_joints) f[i] = terms.body[i].inertia * terms.deep.motions[i];
    for (int dof : m.deep_dofs) y[dof] = m.armature[dof] * x[dof];
    if (body) return;
    for (size_t n = m.deep_dofs.size(); n-- > 0;) {
        const int dof = m.deep_dofs[n], i = m.dof_joint[dof];
        const Joint& j = m.joints[i];
        y[dof] += dot(terms.J[dof], f[i]);
        if (dof == j.iv && j.parent != 0) f[j.parent] += before(f[i], terms.deep.shift[i]);
    }
}

PN_WIDE void mass_matrix_articulated(const Mechanism& m, const BodyTerms& terms, int first, int size,
                                     std::vector<ArticulatedInertia>& composite, double* M) {
    composite.resize(m.joints.size());
    for (int dof = first; dof < first + size; ++dof)
        composite[m.dof_joint[dof]] = articulated(terms.body[m.dof_joint[dof]].inertia);
    for (int dof = first + size - 1; dof >= first; --dof) {
        int i = m.dof_joint[dof];
        Force f = composite[i] * terms.J[dof];
        double* row = M + (dof - first) * size;
        row[dof - first] = dot(terms.J[dof], f) + m.armature[dof];
        for (int above = m.dof_parent[dof]; above >= 0; above = m.dof_parent[above]) {
            for (; i != m.dof_joint[above]; i = m.joints[i].parent) f = before(f, terms.deep.shift[i]);
            row[above - first] = M[(above - first) * size + dof - first] = dot(terms.J[above], f);
        }
        const int own = m.dof_joint[dof], parent = m.joints[own].parent;
        if (dof == m.joints[own].iv && parent != 0) composite[parent] += before(composite[own], terms.deep.shift[own]);
    }
}

}  // namespace pn
