// Least-norm forces of friction among all forces within their limits that give the same motion.
//
// Elements that depend on each other share the load. Their forces f = u g with units u minimize |g|^2 subject to a given
// motion W f and |f_e - m_e| <= s_e. The multipliers nu_e >= 0 of the limits maximize the concave dual function
//     min_g |g|^2 / 2 + sum nu_e (|g_e - m_e|^2 - s_e^2) / 2  subject to V^T g given,
// with the range V of u W u, and with m and s in units u. Newton's method with projection on nu >= 0 finds its maximum.
// [Bertsekas: Projected Newton methods for optimization problems with simple constraints, 1982.]
#pragma once

#include <vector>

#include "complementarity/friction_limits.hpp"

namespace pn {

struct LeastNormParameters {
    double rank_tolerance = 1e-10;   // smallest eigenvalue of the scaled response, relative to the largest
    double limit_tolerance = 1e-12;  // error of a force at its limit, relative to the limit
    double force_rounding = 4e-15;   // the same, relative to the largest force
    // Part of the diagonal that is added to the Hessian, which is singular if more limits hold than loads are free.
    double regularization = 1e-9;
    double value_rounding = 1e-15;  // decrease of the dual function that counts as rounding error, relative to it
    int max_iterations = 60;  // maximum number of Newton steps
    int max_halvings = 60;    // maximum number of halvings of a step
};

class LeastNormFriction {
public:
    using Parameters = LeastNormParameters;
    static constexpr Parameters parameters{};

    // Replace the force by the force of least norm with the same motion. Each element has `dims` rows, and its components
    // count with its mean response in W. Return false, with the force unchanged, if the iteration fails.
    bool solve(const MatX& W, const std::vector<int>& dims, const FrictionLimits& limits, VecX& force);

private:
    struct Element {
        int row, dim;
        double limit;     // s_e
        double nu;        // multiplier of the limit
        double distance;  // |g_e - m_e|
        double excess() const { return distance - limit; }
        double gradient() const { return 0.5 * (distance + limit) * excess(); }
    };

    void read(const MatX& W, const std::vector<int>& dims, const FrictionLimits& limits, const VecX& force);
    double evaluate();
    bool is_done() const;
    void respond(const Element& element, VecX& change) const;
    void find_step();
    bool move();

    std::vector<Element> elements_;
    VecX unit_, middle_;  // units and middles per row
    MatX range_;          // V
    VecX motion_;         // V^T g
    VecX weight_, offset_, g_, change_;
    double value_ = 0.0;         // value of the dual function
    std::vector<int> changed_;   // elements whose multipliers change
    VecX step_;                  // step of these multipliers
    Eigen::LLT<MatX> factor_;    // factor of V^T V / (1 + nu)
};

}  // namespace pn
