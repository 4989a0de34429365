#include "run/output/dense_output.hpp"

#include <cmath>

namespace pn {

DenseRecorder::DenseRecorder(System& system, Stepper& stepper, bool holds_torque, DenseOutput& out)
    : system_(system), stepper_(stepper), holds_torque_(holds_torque), out_(out), state_(VecX::Zero(system.ny)) {}

double DenseRecorder::part(int point, int points) { return 0.5 * (1.0 - std::cos(M_PI * point / (points - 1))); }

void DenseRecorder::find_turning() {
    turning_.clear();
    for (int e : system_.w.now.loaded_elements)
        if (system_.p.frictions[e].dim > 1) turning_.push_back(e);
}

// Store the state, and the slip directions in the workspace.
void DenseRecorder::state_at_point() {
    out_.states.insert(out_.states.end(), state_.data(), state_.data() + system_.ns);
    for (int e : turning_)
        for (int k = 0; k < 3; ++k) out_.directions.push_back(system_.w.state.last_direction[e][k]);
}

void DenseRecorder::step(const EnergyChanges& changes) {
    find_turning();
    RunState& state = system_.w.state;
    const std::vector<Vec3> by_end = state.last_direction;
    stepper_.make_interpolant();
    state.last_direction = by_end;  // further stages of the interpolant have changed the directions
    const int n = points(stepper_.method);
    for (int k = 0; k < n; ++k) {
        stepper_.interpolate(part(k, n), state_);
        state_at_point();
    }
    rest_of_step(stepper_.t0, stepper_.t0 + stepper_.h, changes, stepper_.collocates());
}

void DenseRecorder::straight(const StepStart& start, double t1, const VecX& y1, const EnergyChanges& changes) {
    find_turning();
    const int n = points(stepper_.method);
    for (int k = 0; k < n; ++k) {
        state_ = start.y + part(k, n) * (y1 - start.y);
        system_.normalize(state_);
        state_at_point();
    }
    rest_of_step(start.t, t1, changes, false);
    const auto closed = out_.closed.end() - system_.ng;
    for (int i = 0; i < system_.ng; ++i) closed[i] &= start.closed[i];
    const auto mode = out_.modes.end() - system_.ne;
    for (int e = 0; e < system_.ne; ++e)
        if (mode[e] == sticking && slips(start.mode[e])) mode[e] = start.mode[e];
}

void DenseRecorder::rest_of_step(double t0, double t1, const EnergyChanges& changes, bool sought) {
    const Workspace& w = system_.w;
    out_.times.insert(out_.times.end(), {t0, t1});
    out_.moved.push_back(changes.projections);
    out_.impacts.insert(out_.impacts.end(), {changes.impacts_before, changes.impacts});
    out_.sought.push_back(sought);
    out_.turning.insert(out_.turning.end(), turning_.begin(), turning_.end());
    out_.turning_counts.push_back(static_cast<std::int32_t>(turning_.size()));
    for (int e = 0; e < system_.ne; ++e) out_.modes.push_back(w.state.mode[e]);
    out_.closed.insert(out_.closed.end(), w.state.closed.begin(), w.state.closed.end());
    if (!holds_torque_) return;
    const VecX none = VecX::Constant(system_.nv, NAN);
    const VecX& held = w.now.has_override ? w.now.override_torque : w.state.has_held ? w.state.held_torque : none;
    out_.torque.insert(out_.torque.end(), held.data(), held.data() + held.size());
}

}  // namespace pn
