// Primal-dual interior-point method along the central path of an island's laws, without the matrix of the responses. The
// scaling S of an element, and E dw = dw + mu s . dw_t on the normal's row with the direction of slip s, give
//     S df + E dw = r,   M dx = J^T df,   dw = J dx.
// With G = S^-1 E and z = S^-1 r that is (M + J^T G J) dx = J^T z and df = z - G J dx, as in newton.hpp.
#pragma once

#include "complementarity/blocks/newton.hpp"
#include "complementarity/central_path.hpp"

namespace pn {

// Numbers are in the problem's units, in which the largest free velocity and the responses are about 1.
struct BlockInteriorPointParameters {
    int max_steps = 40;              // maximum steps along the path
    double gap_tolerance = 1e-9;     // mean of force times velocity, z . u, of the elements at the end of the path
    double residual_tolerance = 1e-6;  // largest residual at the end of the path
    double min_step = 1e-5;          // fraction of a step below which rounding allows no further progress
    double smooth_speed = 1e-12;     // slip speed below which the direction is undefined
    double proximal = 1e-8;          // weight of the proximal term of elements without a cone
};

class BlockInteriorPoint {
public:
    using Parameters = BlockInteriorPointParameters;
    static constexpr Parameters parameters{};

    // follows: the slip speeds mu |w_t| of the correction enter the equations with their derivatives.
    // lags: each step has the slip speeds of the last one. Its equations are symmetric.
    // none: without the correction, the laws are a convex problem. The bodies rest in its solution if any forces within
    // the cones hold them.
    enum class Slip { follows, lags, none };

    // Compute forces f near the end of the path, with their motion x, w. `factor` keeps the order of elimination.
    void follow(const BlockProblem& p, const BlockNewton& newton, const Island& island, BlockFactor& factor, Slip slip,
                VecX& f, VecX& x, VecX& w);
    int steps() const { return steps_; }  // steps since construction

private:
    struct Point : PathPoint {
        int row = 0, dim = 0, heads = 0, tails = 0;  // first row, and numbers of all, of normal and of tangential rows
        bool in_path = true;
        double mu = 0.0, root = 1.0;
        double unit[3] = {1.0, 1.0, 1.0};                 // unit of forces, inverse unit of velocities
        Eigen::Matrix3d inverse = Eigen::Matrix3d::Zero();  // S^-1
        Eigen::Vector3d residual = Eigen::Vector3d::Zero();  // residual of u = w + (mu |w_t|, 0)
    };

    void start(const BlockProblem& p, const BlockNewton& newton, const Island& island, VecX& f);
    void update(Slip slip, const VecX& w);
    void scale(const Island& island, Slip slip);
    void invert(Point& point) const;
    void direction(const BlockProblem& p, const Island& island, const BlockFactor& factor, double target, double keep);
    bool move(double part, VecX& f);
    double length() const;
    double gap() const;
    double residual() const;
    Cone force(const Point& point, const VecX& f, double head) const;

    std::vector<Point> points_;
    std::vector<double> G_;
    VecX z_, df_, dx_, dw_, before_;
    double speed_ = 1.0;  // unit of square roots of energies
    int steps_ = 0;
};

}  // namespace pn
