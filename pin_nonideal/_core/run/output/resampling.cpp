#include "run/output/resampling.hpp"

#include <algorithm>

#include "dynamics/evaluation.hpp"
#include "dynamics/state_projection.hpp"
#include "dynamics/friction_limit.hpp"
#include "dynamics/step_start.hpp"
#include "math/tolerances.hpp"

namespace pn {

StepPolynomials::StepPolynomials(const double* states, int points, int size)
    : states_(states), points_(points), size_(size) {
    for (int k = 0; k < points; ++k) {
        places_.push_back(DenseRecorder::part(k, points));
        weights_.push_back((k % 2 == 0 ? 1.0 : -1.0) * (k == 0 || k == points - 1 ? 0.5 : 1.0));
    }
}

void StepPolynomials::at(size_t step, double part, double* out) const {
    const double* value = states_ + step * points_ * size_;
    std::fill(out, out + size_, 0.0);
    double weights = 0.0;
    for (int k = 0; k < points_; ++k, value += size_) {
        const double apart = part - places_[k];
        if (apart == 0.0) {
            std::copy(value, value + size_, out);
            return;
        }
        const double weight = weights_[k] / apart;
        for (int i = 0; i < size_; ++i) out[i] += weight * value[i];
        weights += weight;
    }
    for (int i = 0; i < size_; ++i) out[i] /= weights;
}

// Set the stretch between breaks: of the step that begins at t, or of the last step at the end of the run.
static void enter_stretch(const Program& p, Workspace& w, double t, double end) {
    const auto first = p.breaks.begin(), last = p.breaks.end();
    const auto next = t < end ? std::upper_bound(first, last, t) : std::lower_bound(first, last, t);
    w.now.set_stretch(next == first ? -HUGE_VAL : *(next - 1), next == last ? HUGE_VAL : *next);
}

static void hold(const Program& p, Workspace& w, const InsideStates& inside, size_t k) {
    const bool is_same = k > 0 && inside.modes[k] == inside.modes[k - 1] && inside.closed[k] == inside.closed[k - 1];
    if (!is_same) set_contacts(p, w, inside.closed[k], inside.modes[k]);
    w.state.warm = false;
    w.now.has_override = !inside.torque.empty() && inside.torque[k].allFinite();
    if (w.now.has_override) w.now.override_torque = inside.torque[k];
}

// Set the slip directions of a state: from the step's polynomial if the step solved for them, else from the slip.
static void set_directions(const Program& p, Workspace& w, const System& system, const InsideStates& inside, size_t k) {
    RunState& state = w.state;
    state.solves_directions = false;
    reset_slip_directions(w);
    const VecX& directions = inside.directions[k];
    for (size_t i = 0; i < inside.turning.size(); ++i)
        state.last_direction[inside.turning[i]] = directions.segment<3>(3 * i).stableNormalized();
    const std::vector<char>& sought = inside.sought[k];
    if (std::find(sought.begin(), sought.end(), 1) == sought.end()) return;
    update_kinematics(p, w, inside.t[k], system.q, system.v);
    for (size_t e = 0; e < sought.size(); ++e) {
        const Vec3 u = slip_velocity(w.now, p.frictions[e]);
        if (!sought[e] && u.norm() > min_directed_speed * (1.0 + system.v.cwiseAbs().maxCoeff()))
            state.last_direction[e] = u.normalized();
    }
    state.solves_directions = true;
}

void sample_inside(const Program& p, Workspace& w, const InsideStates& inside, const RecordOptions& options,
                   Recording& out) {
    System system(p, w, options.energy);
    Recorder recorder(system, options, out);
    VecX y = VecX::Zero(system.ny), rate = y;
    for (size_t k = 0; k < inside.t.size(); ++k) {
        y.head(system.ns) = inside.y[k];
        system.normalize(y);
        enter_stretch(p, w, inside.t[k], inside.end);
        hold(p, w, inside, k);
        system.read(y);
        set_directions(p, w, system, inside, k);
        system.read_law_states(y);
        configure(p, w, inside.t[k], system.q, system.v);
        choose_rows_near(p, w, inside.t[k], system.q, system.v);
        project_into_modes(p, w, inside.t[k], system.q, system.v);
        system.write(y);
        // The modes of a time step with contacts may allow no motion inside the step.
        const bool evaluates = options.evaluates() && !p.gaps.empty();
        if (evaluates) system.evaluate_step_end(inside.t[k], y, rate, true);
        recorder.sample(inside.t[k], y, {inside.impacts[k], inside.moved[k]}, evaluates);
    }
}

}  // namespace pn
