#include "run/events/unloaded_contacts.hpp"

#include <algorithm>

#include "contact/queries.hpp"
#include "dynamics/evaluation.hpp"
#include "dynamics/failure.hpp"
#include "dynamics/step_start.hpp"

namespace pn {

namespace {

std::vector<int> contacts_of_bodies(const Program& p, const Workspace& w, int gap) {
    std::vector<int> list;
    for (int i : w.now.closed_gaps)
        if (same_bodies(p, i, gap) && !is_bare(p, i)) list.push_back(i);
    return list;
}

// Check if the current motion, without these contacts, closes none of them. With friction it must also equal the motion
// `acceleration` with these contacts, since friction may hold bodies that are pressed by nothing else.
bool needs_no_force(System& system, double t, const std::vector<int>& open, const VecX& acceleration) {
    const Program& p = system.p;
    Workspace& w = system.w;
    const bool rubs = std::any_of(open.begin(), open.end(), [&](int i) { return !p.gaps[i].elements.empty(); });
    const double tolerance =
        unloaded_contacts_parameters.same_acceleration * (acceleration.cwiseAbs().maxCoeff() + p.mechanism.gravity.norm());
    if (rubs && !((w.now.a - acceleration).cwiseAbs().maxCoeff() <= tolerance)) return false;
    return std::all_of(open.begin(), open.end(), [&](int i) {
        evaluate_gap(p, w, t, system.v, i);
        return gap_acceleration(p, w, i) >= -std::max(tolerance, acceleration_rounding(p, w, i));
    });
}

// Check the motion without these contacts, and restore the motion with them.
bool moves_without(System& system, double t, const std::vector<int>& contacts) {
    const Program& p = system.p;
    Workspace& w = system.w;
    const RunState before = w.state;
    const VecX acceleration = w.now.a;
    std::vector<char> closed = before.closed;
    for (int i : contacts) closed[i] = 0;
    bool is_needless = false;
    attempt([&] {  // a failure means that there is no motion without these contacts
        set_closed(p, w, closed);
        begin_step(p, w, t, system.q, system.v);
        is_needless = needs_no_force(system, t, contacts, acceleration);
    });
    set_contacts(p, w, before.closed, before.mode);
    w.state = before;
    begin_step(p, w, t, system.q, system.v);
    return is_needless;
}

}  // namespace

bool is_unloaded(System& system, double t, int gap) {
    const Program& p = system.p;
    Workspace& w = system.w;
    const std::vector<int> contacts = contacts_of_bodies(p, w, gap);
    double largest = 0.0;  // load, in its rounding
    for (int i : contacts) largest = std::max(largest, load(p, w, i) / load_rounding(p, w, i));
    return largest <= 1.0 ||
           (largest <= unloaded_contacts_parameters.surely_pressing && moves_without(system, t, contacts));
}

std::vector<int> open_unloaded_contacts(System& system, double t) {
    const Program& p = system.p;
    Workspace& w = system.w;
    std::vector<int> opened_gaps;
    const std::vector<int> closed_gaps = w.now.closed_gaps;
    for (int gap : closed_gaps) {
        if (!w.state.closed[gap] || !is_unloaded(system, t, gap)) continue;
        std::vector<char> closed = w.state.closed;
        for (int i : closed_gaps) {
            if (!closed[i] || !same_bodies(p, i, gap)) continue;
            closed[i] = 0;
            opened_gaps.push_back(i);
        }
        set_closed(p, w, closed);
        begin_step(p, w, t, system.q, system.v);
    }
    return opened_gaps;
}

}  // namespace pn
