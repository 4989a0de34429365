// Factor of M for deep trees, from the articulated-body recursion. M itself is not needed. Its condition grows with the
// fourth power of the depth. The innovations factor of M^-1 = (1 - H psi K)^T D^-1 (1 - H psi K)
// [Rodriguez, Jain, Kreutz-Delgado, 1992] is the same R = L^T D^1/2 as that of the rows (tree/mass_factor.hpp). R^-1 is
// a sweep toward the roots and R^-T a sweep toward the leaves. The time of a sweep is linear in the number of dofs.
// Forces known as wrenches enter on the bodies. As generalized forces such wrenches would be long sums, which the sweep
// would decompose again.
#pragma once

#include <vector>

#include "tree/body_terms.hpp"

namespace pn {

// Compute gains and pivots of the dofs of deep trees. Return -1, or the dof with a pivot that is not positive.
int factorize_articulated(const Mechanism& m, BodyTerms& terms);

// Sweeps of mass_factor.hpp for the dofs of deep trees. Forces `body` on bodies, about their reference points, are
// added to x if given.
void solve_R_articulated(const Mechanism& m, BodyTerms& terms, const Force* body, VecX& x);
void solve_Rt_articulated(const Mechanism& m, BodyTerms& terms, const std::vector<int>& dofs, VecX& x);
// x := R^-1 x on the listed dofs, which are descending and closed under ancestors. The entries of x follow the list,
// `stride` apart. The wrenches +f1 on the body of joint1 and -f2 on the body of joint2 are added to x.
void scale_row_articulated(const Mechanism& m, BodyTerms& terms, const std::vector<int>& dofs, int joint1, const Force& f1,
                           int joint2, const Force& f2, double* x, int stride);

// Compute motions of the bodies of deep trees for the velocities x, into Articulation::motions.
void move_articulated(const Mechanism& m, BodyTerms& terms, const VecX& x);
// y := M x on the dofs of deep trees. If `body` is given, it takes the inertia forces of the bodies, and y only the
// armature part. Otherwise y takes both.
void multiply_M_articulated(const Mechanism& m, BodyTerms& terms, const VecX& x, Force* body, VecX& y);

// Compute M of a deep tree, whose `size` dofs follow one another from `first` on, as a full matrix: the inertias of the
// subtrees, from the leaves to the root [Featherstone 2008, 6.2]. `composite`: work space.
void mass_matrix_articulated(const Mechanism& m, const BodyTerms& terms, int first, int size,
                             std::vector<ArticulatedInertia>& composite, double* M);

}  // namespace pn
