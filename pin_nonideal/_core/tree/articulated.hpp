// The factor of M where the tree is deep, from the articulated-body recursion: M itself, whose condition grows with the
// fourth power of the depth, is never formed. The innovations factor of M^-1 = (1 - H psi K)^T D^-1 (1 - H psi K)
// [Rodriguez, Jain, Kreutz-Delgado, 1992] is the same R = L^T D^1/2 as that of the rows (tree/factor.hpp): R^-1 is a sweep
// toward the roots and R^-T one toward the leaves, each in time with the number of dofs. Forces enter as wrenches on the
// bodies wherever they are known so; as generalized forces they would be long sums, to be taken apart again.
#pragma once

#include <vector>

#include "tree/body_terms.hpp"

namespace pn {

// Gains and pivots of the dofs of deep trees. Returns -1, or the dof whose pivot is not positive.
int factorize_articulated(const Mechanism& m, BodyTerms& terms);

// The sweeps of mass_factor.hpp for the dofs of deep trees. Forces on bodies, about their reference points, add to x where
// they are given.
void solve_R_articulated(const Mechanism& m, BodyTerms& terms, const Force* body, VecX& x);
void solve_Rt_articulated(const Mechanism& m, BodyTerms& terms, const std::vector<int>& dofs, VecX& x);
// x := R^-1 x on the dofs listed, descending and closed under ancestors, x by place in the list and `stride` apart; with
// the forces +-f1 and -+f2 on two bodies.
void scale_row_articulated(const Mechanism& m, BodyTerms& terms, const std::vector<int>& dofs, int joint1, const Force& f1,
                           int joint2, const Force& f2, double* x, int stride);

// Motions of the bodies of deep trees for the velocities x, into Articulation::motions.
void move_articulated(const Mechanism& m, BodyTerms& terms, const VecX& x);
// y := M x on their dofs: of the bodies' inertias as forces on them into `body`, or where it is null summed up the trees.
void multiply_M_articulated(const Mechanism& m, BodyTerms& terms, const VecX& x, Force* body, VecX& y);

}  // namespace pn
