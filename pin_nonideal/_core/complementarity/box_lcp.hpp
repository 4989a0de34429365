// Friction forces of elements of one direction, at rest, all at once: min f^T W f / 2 + alpha0^T f in the box
// |f_e| <= s_e, exactly. Pure functions on arrays.
#pragma once

#include <vector>

#include "complementarity/small_dense.hpp"

namespace pn {

// Responses below this part of the largest are none; rank_tolerance_sticking is its square root.
constexpr double rank_threshold = 1e-13;

// In room that is kept: a program no larger than one before takes no memory.
class BoxProgram {
public:
    // `near`: forces of a program like this one, whose choice of those that are at their limits is tried first; f may be
    // the same.
    void solve(const MatX& W, const VecX& alpha0, const VecX& s, const VecX* near, VecX& f);
    // x of least norm with W x = r, W symmetric without negative eigenvalues; of a part of r where no x gives all of it.
    void solve_all(const MatX& W, const VecX& r, VecX& x);

private:
    void start(const VecX& s, const VecX* near);
    bool pivot_blocks(const MatX& W, const VecX& alpha0, const VecX& s);
    void descend(const MatX& W, const VecX& alpha0, const VecX& s);
    void solve_free(const MatX& W);
    void measure(const MatX& W, const VecX& alpha0, const VecX& forces);
    bool solve_regular(int n);

    std::vector<char> is_free_;
    std::vector<int> list_, wrong_;
    VecX near_, f_, alpha_, r_, x_, left_;
    VecX size_;           // of the accelerations in play, of each element
    double noise_ = 0.0;  // what those of the lightest leave to the others by rounding
    Buffer A_, L_, inverse_, scale_, rhs_, part_, change_;
    DenseSolver solver_;
};

VecX least_norm_solution(const MatX& W, const VecX& r);
VecX box_program(const MatX& W, const VecX& alpha0, const VecX& s, const VecX* near = nullptr);

}  // namespace pn
