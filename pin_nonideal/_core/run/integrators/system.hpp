// The right-hand side of y' = f(t, y) on the flat state y = (q, v, z, work, watch): z are the states of laws, work the
// integrals of the ledger's powers. watch has two numbers for each frictional element, whose rates the stages leave
// behind: of one that sticks force / limit, so that the step control resolves a load that comes and goes while nothing
// moves, and the stages tell whether a limit was passed; of one that slips its slip speed and the rate of that, which
// tell whether it came to rest inside the step. Of each gap one number follows, whose rate is the normal force while it
// is closed: where redundant contacts share it, +1 while all can press and -1 where they cannot.
//
// q is integrated in ambient coordinates (a quaternion as four numbers): the right-hand side extends smoothly off the
// unit sphere, so the order is kept, and lengths are restored at the step's end.
#pragma once

#include "contact/active_set.hpp"

namespace pn {

struct System {
    const Program& p;
    Workspace& w;
    const bool energy;  // integrate the powers of the ledger
    // Near a singular position the motion off the constraints differs wildly from the motion on them, so stages are
    // projected first: y' = f(P(y)) has the same solutions and no such cliff.
    bool on_constraints = false;
    bool seeks_directions = true;  // the steps can find directions of slip that is too slow to tell them
    double smallest_pivot = 1.0;  // of the rows' factor, over the evaluations since it was set
    double moved_energy = 0.0;    // by the last projection of a step's end, where the ledger is kept
    const int nq, nv, nz, nw, ne, ng, ns, ny;  // sizes of q, v, z, work, elements, gaps, y without watch, y
    VecX q, v;                         // of the state read last
    TouchingKnown touching;            // as found last

    System(const Program& program, Workspace& workspace, bool with_energy);

    // Whether anything in the scene may end a smooth stretch of motion by itself.
    bool has_events() const { return ne > 0 || ng > 0 || !p.contacts.empty(); }
    // Whether elements or gaps are watched in the modes that hold now: some are not open.
    bool watches() const { return !w.now.loaded.empty() || !w.now.touching.empty(); }
    // So many numbers of a state or rate are read; those behind belong to what is open.
    int active() const {
        if (!w.now.touching.empty()) return ny;
        return w.now.loaded.empty() ? ns : ns + 2 * (w.now.loaded.back() + 1);
    }
    // Takes q and v from y, or puts them there.
    void read(const VecX& y);
    void write(VecX& y) const;
    // Takes the states of laws from y.
    void read_law_states(const VecX& y);
    auto velocity(const VecX& y) const { return y.segment(nq, nv); }
    auto work(VecX& y) const { return y.segment(nq + nv + nz, nw); }
    double share(const VecX& dy, int element) const { return dy[ns + 2 * element]; }
    double slip(const VecX& dy, int element) const { return dy[ns + 2 * element]; }
    double slip_rate(const VecX& dy, int element) const { return dy[ns + 2 * element + 1]; }

    double load(const VecX& dy, int gap) const { return dy[ns + 2 * ne + gap]; }

    void derivative(double t, const VecX& y, VecX& dy);
    // dy from the evaluation that the workspace holds.
    void rate_of_evaluation(double t, const VecX& y, VecX& dy);
    // Brings a step's end onto the constraints and evaluates there, as the next step begins.
    void project_and_evaluate(double t, VecX& y, VecX& dy);
    // The same of a step of time stepping, whose modes have just been set; evaluated only where that is asked for.
    // `goes_through`: where these modes have no motion, what slips rubs on as it did in the step.
    void settle(double t, VecX& y, VecX& dy, bool evaluates, bool goes_through);
    // Whether y needs no projection; all that a sample of it tells is evaluated then, and no more.
    bool is_on_constraints(double t, const VecX& y);
    void normalize(VecX& y) const;

private:
    // dy at q and v, from the evaluation there.
    void write_rate(double t, VecX& dy);
    void watch(double t, VecX& dy);
    void watch_loads(VecX& dy);
    double energy_at(const VecX& y);
    bool settle_velocity(double t, bool chosen, bool evaluates, bool goes_through);

    VecX q_before_;
};

}  // namespace pn
