// Right-hand side of y' = f(t, y) on the flat state y = (q, v, z, work, watch). z are the law states, and work the
// integrals of the ledger's powers.
//
// watch has two entries per friction element, whose rates the stages store:
// - Sticking element: the rate is force / limit. Step control then resolves a load that changes while nothing moves.
// The stages show if a limit was passed.
// - Slipping element: the rates are the slip speed and the derivative of the slip speed. The stages show if slip came to
// rest inside the step. One entry per gap follows. The rate of this entry is the normal force while the gap is closed. If
// redundant contacts share the force, it is +1 while nonnegative loads exist, else -1.
//
// q is integrated in ambient coordinates (a quaternion as four numbers). The right-hand side extends smoothly off the
// unit sphere, so the order is kept. Unit lengths are restored at the step's end.
#pragma once

#include "contact/touching_contacts.hpp"

namespace pn {

struct System {
    const Program& p;
    Workspace& w;
    const bool energy;  // integrate the powers of the ledger
    // Project the stages first. Near a singular position the motion off the constraints differs wildly from the motion
    // on them. The projected equation y' = f(P(y)) has the same solutions without this difference.
    bool on_constraints = false;
    bool can_solve_directions = true;  // steps can solve for slip directions that slow slip does not define
    double smallest_pivot = 1.0;  // smallest pivot of the rows' factor since the last reset
    double numerical_energy = 0.0;  // energy change due to the last projection of a step's end [J], if the ledger is kept
    const int nq, nv, nz, nw, ne, ng, ns, ny;  // sizes of q, v, z, work, elements, gaps, y without watch, y
    VecX q, v;                         // state read last
    TouchingCache touching;            // touching contacts of the last state

    System(const Program& program, Workspace& workspace, bool with_energy);

    // Check if the scene has elements, gaps or contacts that can cause events.
    bool has_events() const { return ne > 0 || ng > 0 || !p.contacts.empty(); }
    // Check if an element or gap is active in the current modes, and therefore watched.
    bool watches() const { return !w.now.loaded_elements.empty() || !w.now.closed_gaps.empty(); }
    // Number of leading entries of a state or rate in use. The entries behind belong to open contacts.
    int active() const {
        if (!w.now.closed_gaps.empty()) return ny;
        return w.now.loaded_elements.empty() ? ns : ns + 2 * (w.now.loaded_elements.back() + 1);
    }
    // Check if y stays the same in a step that starts with this rate: nothing moves, and nothing depends on time.
    bool stands(const VecX& y, const VecX& dy) const;
    // Copy q and v from y, or to y.
    void read(const VecX& y);
    void write(VecX& y) const;
    // Copy the law states from y.
    void read_law_states(const VecX& y);
    auto velocity(const VecX& y) const { return y.segment(nq, nv); }
    auto work(VecX& y) const { return y.segment(nq + nv + nz, nw); }
    double share(const VecX& dy, int element) const { return dy[ns + 2 * element]; }
    double slip(const VecX& dy, int element) const { return dy[ns + 2 * element]; }
    double slip_rate(const VecX& dy, int element) const { return dy[ns + 2 * element + 1]; }

    double load(const VecX& dy, int gap) const { return dy[ns + 2 * ne + gap]; }

    void derivative(double t, const VecX& y, VecX& dy);
    // Compute dy from the evaluation in the workspace.
    void rate_of_evaluation(double t, const VecX& y, VecX& dy);
    // Project a step's end onto the constraints, and evaluate the projected state for the next step.
    void project_and_evaluate(double t, VecX& y, VecX& dy);
    // Project the end of a step of time stepping, whose modes have just been set. Evaluate only if `evaluates`.
    // `may_lack_motion`: the run locates no events, and if these modes have no motion, slipping elements keep the
    // friction of the step.
    enum class SlipDirection { of_step, of_end };  // directions of slip at which the end is evaluated
    void settle(double t, VecX& y, VecX& dy, bool evaluates, bool may_lack_motion, SlipDirection directions);
    // Evaluate the projected end of such a step.
    void evaluate_step_end(double t, const VecX& y, VecX& dy, bool may_lack_motion);
    // Check if y needs no projection. The quantities of a sample at y are then evaluated.
    bool is_on_constraints(double t, const VecX& y);
    void normalize(VecX& y) const;

private:
    // Write dy at q and v from the evaluation in the workspace, with the quantities whose roots are events if
    // `locates_events`.
    void write_rate(double t, VecX& dy, bool locates_events = true);
    void watch(double t, VecX& dy);
    void watch_loads(VecX& dy);
    double energy_at(const VecX& y);
    template <class Act>
    bool attempt_motion(double t, bool may_lack_motion, const Act& act);

    VecX q_before_;
};

}  // namespace pn
