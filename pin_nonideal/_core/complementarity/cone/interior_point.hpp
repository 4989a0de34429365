// Central path of a cone problem: a primal-dual interior-point method in Nesterov and Todd's scaling, some fifteen
// steps however singular W is. De Saxce's correction mu |w_t| enters Newton's equations with its derivative
// (Slip::follows). With Slip::stands it keeps its first value, and each problem is convex if W is symmetric.
#pragma once

#include "complementarity/central_path.hpp"

namespace pn {

struct ConeInteriorPointParameters {
    int max_steps = 60;            // maximum steps along the path
    double gap_tolerance = 1e-15;  // mean z . u of the elements at the end, in the problem's units: rounding
    double min_step = 1e-7;        // fraction of a step below which rounding allows no further progress
    double smooth_speed = 1e-12;   // slip speed below which the direction is undefined
};

class ConeInteriorPoint {
public:
    using Parameters = ConeInteriorPointParameters;
    static constexpr Parameters parameters{};

    enum class Slip { follows, stands };

    // Compute f at the end of the path, up to rounding. With Slip::stands the slip speeds are those of the given `f`.
    void follow(const ConeProblem& problem, Eigen::Ref<VecX> f, Slip slip);
    int steps() const { return steps_; }  // total of all calls

private:
    Cone force(const ConeProblem& p, int e, const Eigen::Ref<const VecX>& f, double head) const;
    Eigen::Vector3d tail(const ConeProblem& p, int e, const Eigen::Ref<const VecX>& x) const;
    void start(const ConeProblem& p, Eigen::Ref<VecX> f, Slip slip);
    void update(const ConeProblem& p, const Eigen::Ref<const VecX>& f);
    bool factorize(const ConeProblem& p);
    void direction(const ConeProblem& p, double target, double keep);
    double length(const ConeProblem& p) const;
    double gap(const ConeProblem& p) const;

    Slip mode_ = Slip::follows;
    std::vector<PathPoint> points_;
    DenseSolver solver_;
    Buffer K_, w_, miss_, rhs_, step_, kept_;
    int steps_ = 0;
};

}  // namespace pn
