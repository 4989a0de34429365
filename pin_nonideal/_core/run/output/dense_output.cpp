#include "run/output/dense_output.hpp"

#include <algorithm>
#include <cmath>

namespace pn {

DenseRecorder::DenseRecorder(System& system, Stepper& stepper, bool holds_torque, DenseOutput& out)
    : system_(system), stepper_(stepper), holds_torque_(holds_torque),
      turns_(std::any_of(system.p.frictions.begin(), system.p.frictions.end(), [](const auto& f) { return f.dim > 1; })),
      out_(out), state_(VecX::Zero(system.ny)) {}

double DenseRecorder::part(int point, int points) { return 0.5 * (1.0 - std::cos(M_PI * point / (points - 1))); }

// Store the state, and the slip directions in the workspace.
void DenseRecorder::state_at_point() {
    out_.states.insert(out_.states.end(), state_.data(), state_.data() + system_.ns);
    if (!turns_) return;
    for (const Vec3& n : system_.w.state.last_direction)
        for (int k = 0; k < 3; ++k) out_.directions.push_back(n[k]);
}

void DenseRecorder::step(double numerical_energy) {
    RunState& state = system_.w.state;
    const std::vector<Vec3> by_end = state.last_direction;
    stepper_.make_interpolant();
    state.last_direction = by_end;  // further stages of the interpolant have changed the directions
    const int n = points(stepper_.method);
    for (int k = 0; k < n; ++k) {
        stepper_.interpolate(part(k, n), state_);
        state_at_point();
    }
    rest_of_step(stepper_.t0, stepper_.t0 + stepper_.h, numerical_energy, stepper_.collocates());
}

void DenseRecorder::straight(double t0, const VecX& y0, double t1, const VecX& y1, double numerical_energy) {
    const int n = points(stepper_.method);
    for (int k = 0; k < n; ++k) {
        state_ = y0 + part(k, n) * (y1 - y0);
        system_.normalize(state_);
        state_at_point();
    }
    rest_of_step(t0, t1, numerical_energy, false);
}

void DenseRecorder::rest_of_step(double t0, double t1, double numerical_energy, bool sought) {
    const Workspace& w = system_.w;
    out_.times.insert(out_.times.end(), {t0, t1});
    out_.moved.push_back(numerical_energy);
    out_.sought.push_back(sought);
    for (int e = 0; e < system_.ne; ++e) out_.modes.push_back(w.state.mode[e]);
    if (!holds_torque_) return;
    const VecX none = VecX::Constant(system_.nv, NAN);
    const VecX& held = w.now.has_override ? w.now.override_torque : w.state.has_held ? w.state.held_torque : none;
    out_.torque.insert(out_.torque.end(), held.data(), held.data() + held.size());
}

}  // namespace pn
