// Friction forces of elements of one direction, at rest, all at once: minimize f^T W f / 2 + alpha0^T f in the box
// |f_e| <= s_e, exactly. Pure functions on arrays.
#pragma once

#include <vector>

#include "complementarity/small_dense.hpp"

namespace pn {

// Responses below this fraction of the largest count as zero. rank_tolerance_sticking is its square root.
constexpr double response_rank_threshold = 1e-13;

struct BoxLcpParameters {
    double zero_acceleration = 1e-9;  // fraction of the acceleration scale that counts as zero
    double limit_rounding = 1e-12;    // relative distance within which a force is at its limit
    double rounding = 1e-13;          // rounding, relative to a limit or to the acceleration scale
    double noise_of_others = 1e-14;   // rounding error of other elements, relative to the largest acceleration
    // Smallest root of a pivot of W, scaled to a unit diagonal, for which the Cholesky factor is as good as an
    // orthogonal one.
    double min_pivot = 1e-3;
    int max_stalled_rounds = 10;  // rounds of block pivoting without progress
    int relaxing_sweeps = 20;     // sweeps over the elements before block pivoting starts again
    int max_relaxations = 3;      // maximum number of such starts
};

// Solver with persistent buffers: a program no larger than an earlier one allocates no memory.
class BoxProgram {
public:
    using Parameters = BoxLcpParameters;
    static constexpr Parameters parameters{};
    using MatrixView = Eigen::Ref<const MatX>;

    // Solve for f. `initial` holds the forces of a similar program (warm start), and its set of forces at their limits is
    // tried first. f may be the same vector as `initial`.
    void solve(const MatrixView& W, const VecX& alpha0, const VecX& s, const VecX* initial, VecX& f);
    // Compute the minimum-norm x with W x = r, for a symmetric positive semidefinite W. If this equation has no
    // solution, the residual of x is not zero.
    void solve_all(const MatrixView& W, const VecX& r, VecX& x);

private:
    void start(const VecX& s, const VecX* initial);
    void relax(const MatrixView& W, const VecX& alpha0, const VecX& s);
    bool pivot_blocks(const MatrixView& W, const VecX& alpha0, const VecX& s);
    void descend(const MatrixView& W, const VecX& alpha0, const VecX& s);
    void solve_free(const MatrixView& W);
    void measure(const MatrixView& W, const VecX& alpha0, const VecX& forces);
    bool solve_regular(int n);

    std::vector<char> is_free_;
    std::vector<int> list_, wrong_;
    VecX initial_, f_, alpha_, r_, x_, left_;
    VecX size_;           // scale of the accelerations, per element
    double noise_ = 0.0;  // rounding error that the largest accelerations cause in all elements
    Buffer A_, L_, inverse_, scale_, rhs_, part_, change_;
    DenseSolver solver_;
};

VecX minimum_norm_solution(const MatX& W, const VecX& r);
VecX box_program(const MatX& W, const VecX& alpha0, const VecX& s, const VecX* initial = nullptr);

}  // namespace pn
