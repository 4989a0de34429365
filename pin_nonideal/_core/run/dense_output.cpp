#include "run/dense_output.hpp"

#include <cmath>

namespace pn {

DenseRecorder::DenseRecorder(System& system, Stepper& stepper, bool holds_torque, DenseOutput& out)
    : system_(system), stepper_(stepper), holds_torque_(holds_torque), out_(out), state_(VecX::Zero(system.ny)) {}

double DenseRecorder::part(int point, int points) { return 0.5 * (1.0 - std::cos(M_PI * point / (points - 1))); }

void DenseRecorder::step(double moved_energy) {
    stepper_.make_interpolant();
    const int n = points(stepper_.method);
    for (int k = 0; k < n; ++k) {
        stepper_.interpolate(part(k, n), state_);
        out_.states.insert(out_.states.end(), state_.data(), state_.data() + system_.ns);
    }
    rest_of_step(stepper_.t0, stepper_.t0 + stepper_.h, moved_energy);
}

void DenseRecorder::straight(double t0, const VecX& y0, double t1, const VecX& y1, double moved_energy) {
    const int n = points(stepper_.method);
    for (int k = 0; k < n; ++k) {
        state_ = y0 + part(k, n) * (y1 - y0);
        system_.normalize(state_);
        out_.states.insert(out_.states.end(), state_.data(), state_.data() + system_.ns);
    }
    rest_of_step(t0, t1, moved_energy);
}

void DenseRecorder::rest_of_step(double t0, double t1, double moved_energy) {
    const Workspace& w = system_.w;
    out_.times.insert(out_.times.end(), {t0, t1});
    out_.moved.push_back(moved_energy);
    for (int e = 0; e < system_.ne; ++e) {
        out_.modes.push_back(w.state.mode[e]);
        for (int k = 0; k < 3; ++k) out_.directions.push_back(w.state.last_direction[e][k]);
    }
    if (!holds_torque_) return;
    const VecX none = VecX::Constant(system_.nv, NAN);
    const VecX& held = w.now.has_override ? w.now.override_torque : w.state.has_held ? w.state.held_torque : none;
    out_.torque.insert(out_.torque.end(), held.data(), held.data() + held.size());
}

}  // namespace pn
