// The central path of a cone problem: a primal-dual interior-point method in Nesterov and Todd's scaling, some fifteen
// steps however singular W is. The correction mu |w_t| of de Saxce enters Newton's equations with its derivative; or it
// stands still at what it was, which makes each problem convex where W is symmetric.
#pragma once

#include "complementarity/cone/problem.hpp"
#include "complementarity/second_order_cone.hpp"

namespace pn {

class ConePath {
public:
    enum class Slip { follows, stands };

    // f at the end of the path, as near as rounding lets it come. Standing slip speeds are those under `f` as given.
    void follow(const ConeProblem& problem, Eigen::Ref<VecX> f, Slip slip);
    int steps() const { return steps_; }  // of all calls

private:
    struct State {
        Cone z, y;       // of the force, and of u
        Scaling scaling;
        Cone dy, second;
        double speed = 0.0;  // |w_t|
        Eigen::Vector3d slip = Eigen::Vector3d::Zero();  // its direction
    };
    Cone force(const ConeProblem& p, int e, const Eigen::Ref<const VecX>& f, double head) const;
    Eigen::Vector3d tail(const ConeProblem& p, int e, const Eigen::Ref<const VecX>& x) const;
    void start(const ConeProblem& p, Eigen::Ref<VecX> f, Slip slip);
    void update(const ConeProblem& p, const Eigen::Ref<const VecX>& f);
    bool factorize(const ConeProblem& p);
    void direction(const ConeProblem& p, double target, double keep);
    double length(const ConeProblem& p) const;
    double gap(const ConeProblem& p) const;

    Slip mode_ = Slip::follows;
    std::vector<State> states_;
    DenseSolver solver_;
    Buffer K_, w_, miss_, rhs_, step_, kept_;
    int steps_ = 0;
};

}  // namespace pn
