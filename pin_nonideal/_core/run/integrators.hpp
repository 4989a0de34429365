// Explicit Runge-Kutta methods as data, and one stepping routine on the flat state y = (q, v, z, work, watch).
// watch integrates force / limit of each sticking element, so that the step control resolves a load that comes and
// goes while nothing moves, and the stages tell whether a limit was passed.
//
// q is integrated in ambient coordinates (a quaternion as four numbers): the right-hand side extends smoothly off the
// unit sphere, so the order is kept, and lengths are restored at the step's end.
#pragma once

#include <string>

#include "dynamics/workspace.hpp"

namespace pn {

struct Method {
    enum class Kind { dop853, dopri5, rk4, semi_implicit_euler, moreau } kind;
    int stages = 0, order = 0;
    bool adaptive = false;
    const double *A = nullptr, *B = nullptr, *C = nullptr;
};

Method method_named(const std::string& name);

// The right-hand side of y' = f(t, y) and its storage.
struct System {
    const Program& p;
    Workspace& w;
    bool energy = false;  // integrate the powers of the ledger
    // Near a singular position the motion off the constraints differs wildly from the motion on them, so stages are
    // projected first: y' = f(P(y)) has the same solutions and no such cliff.
    bool on_constraints = false;
    double smallest_pivot = 1.0;  // of the rows' factor, over the evaluations since it was set
    int nq, nv, nz, nw, ne, ny;  // sizes of q, v, z, work, watched elements, y

    System(const Program& program, Workspace& workspace, bool with_energy);
    void derivative(double t, const VecX& y, VecX& dy);
    // dy from the evaluation that the workspace holds.
    void collect(double t, const VecX& y, VecX& dy);
    auto q(VecX& y) const { return y.head(nq); }
    auto v(VecX& y) const { return y.segment(nq, nv); }

    VecX q_buffer, v_buffer, projected;
};

// Power of actuation, given forces, constraints, and each law, at the evaluation in the workspace.
void powers(const Program& p, Workspace& w, const VecX& v, double* out);

constexpr int most_stages = 16;

// A weighted sum of stage derivatives: those whose weight is not zero, where they stand.
struct Combination {
    int terms = 0;
    double weight[most_stages];
    const double* rate[most_stages];
    Combination() {}
    Combination(const double* weights, int n, const std::vector<VecX>& K);
};

struct Stepper {
    Method method;
    System& system;
    std::vector<VecX> K;  // stage derivatives; K[0] at the step's start
    VecX y0, y1, stage, error5, error3, tangent;
    std::vector<VecX> dense;  // coefficients of the interpolant
    VecX f1;                  // derivative at the step's end
    double t0 = 0.0, h = 0.0;
    bool has_dense = false;
    Stepper(const Method& m, System& s);
    Stepper(const Stepper&) = delete;  // its combinations point into K
    Stepper& operator=(const Stepper&) = delete;

    // y1 = one step of size h from (t0, y0); K[0] must hold the derivative there.
    void step(double t, double size);
    // Norm of the error estimate, 1 at the tolerance.
    double error_norm(double rtol, const VecX& atol);
    // Interpolant over the step; needs f1 for all methods. Leaves the workspace at other states.
    void make_dense();
    void interpolate(double theta, VecX& y) const;
    double initial_step(double t, const VecX& y, double rtol, const VecX& atol, double limit);

private:
    // Largest size so far of each tangent coordinate, velocity and state.
    void magnitude(const VecX& y, VecX& out) const;
    void to_tolerances(double rtol, const VecX& atol);  // of these sizes, in place
    void remove_normal_part(int start);
    double norm(const VecX& dy, const VecX& scale, const VecX& y);
    std::vector<Combination> to_stage_;
    Combination to_end_, to_error5_, to_error3_;
    VecX scale_, probe_, probe_rate_;
    double watch_scale_ = 1.0;
};

}  // namespace pn
