// The equation of rest of a scene at one state: what its elements at rest have to do with each other, and with those
// that slip under a load of their own.
#pragma once

#include "dynamics/reactions.hpp"
#include "friction/problem.hpp"
#include "complementarity/load_dependent/equation.hpp"

namespace pn {

class RestProblem {
public:
    RestEquation equation;

    // Where contacts share a load, the equation is that of the piece in which the motion without friction lies.
    // The workspace must hold the motion in which `resting` and `slipping` (whose limits follow the load) carry no
    // friction; it is left with a motion of no meaning.
    RestProblem(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, const std::vector<int>& resting,
                const std::vector<int>& slipping);
    RestProblem(const RestProblem&) = delete;  // the equation may ask it
    RestProblem& operator=(const RestProblem&) = delete;

    // Of the motion under forces x, where laws are no functions.
    VecX acceleration(const VecX& x) const { return without_ + problem_.response * x; }
    bool has_pieces() const { return equation.loads.rows() > 0 && shares_pressing(p, w); }
    // Whether the motion under forces x is one: no contact that may open pulls, and where some share a load it lies in the
    // piece of the equation, which can be made that of its own.
    bool is_motion(const VecX& x);
    void enter_piece(const VecX& x);
    void enter_piece(const std::vector<char>& unloaded);
    // Of the i-th element: the factor of its limit while it holds and once it has begun to slip.
    double holding_factor(size_t i) const;
    double sliding_factor(size_t i) const;

private:
    const Friction& friction(size_t i) const { return p.frictions[problem_.elements[i]]; }
    void describe(size_t i, bool resting);
    void collect_loads();
    void ask(const VecX& x, VecX& alpha, FrictionLimits& limits);
    // Puts the motion under forces x into the workspace.
    void move(const VecX& x);

    const Program& p;
    Workspace& w;
    const double t;
    const VecX &q, &v;
    FrictionProblem problem_;
    VecX without_, lam_without_;  // acceleration and multipliers without friction
};

}  // namespace pn
