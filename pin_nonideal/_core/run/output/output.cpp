#include "run/output/output.hpp"

#include <algorithm>
#include <cmath>

#include "dynamics/evaluation.hpp"
#include "dynamics/state_projection.hpp"
#include "dynamics/friction_limit.hpp"

namespace pn {

// Maximum number of samples for which memory is reserved. Longer runs reserve more memory as needed.
constexpr double max_reserved_samples = 1e5;

Output::Output(System& system, Stepper& stepper, Progress& progress, const Options& options, Recording& out)
    : p(system.p), w(system.w), system_(system), stepper_(stepper), progress_(progress), options_(options), out_(out),
      recorder_(system, options.record, out),
      dense_(system, stepper, options.callback || std::holds_alternative<SampledTorque>(p.actuation), out.dense),
      sample_(VecX::Zero(system.ny)) {}

void Output::begin() {
    progress_.samples = 1;
    // The step count of adaptive methods is unknown in advance.
    const double apart = options_.output_dt > 0.0 ? options_.output_dt : options_.dt;
    if (apart > 0.0) recorder_.reserve(static_cast<size_t>(std::min(options_.duration / apart + 2.0, max_reserved_samples)));
}

void Output::emit(double time, const VecX& state, bool evaluated, const std::vector<char>* open_gaps) {
    if (!out_.t.empty() && (jumps_ ? time < out_.t.back() : time <= out_.t.back())) return;
    jumps_ = false;
    const GapState& gaps = progress_.gaps;
    recorder_.sample(time, state, {progress_.impact_energy, progress_.numerical_energy}, evaluated,
                     gaps.current ? &gaps.skipped : open_gaps);
}

void Output::before_jump() {
    emit(progress_.t, progress_.y, false);
    jumps_ = true;
}

void Output::now() { emit(progress_.t, progress_.y, true); }

void Output::configured_now() {
    if (!options_.save) return;
    progress_.configured_t = progress_.t;
    progress_.configured_y.head(system_.ns) = progress_.y.head(system_.ns);
}

void Output::end_step(bool is_needed) {
    const double t = progress_.t;
    const bool on_grid = options_.output_dt > 0.0 && std::abs(next() - t) <= same_time(t);
    if (!is_needed && options_.output_dt != 0.0 && !on_grid && t < options_.end()) return;
    progress_.samples += on_grid;
    if (stepper_.has_interpolant() && !system_.has_events()) {  // the workspace may be inside the step
        system_.read(progress_.y);
        evaluate(p, w, t, system_.q, system_.v);
        configured_now();
    }
    now();
}

bool Output::is_on_grid(double rounding) const {
    return options_.output_dt > 0.0 && next() <= progress_.t + std::max(rounding, same_time(progress_.t));
}

bool Output::is_due(double rounding) const {
    return options_.output_dt == 0.0 || is_on_grid(rounding) || !(progress_.t < options_.end());
}

void Output::end_time_step(double rounding, const std::vector<char>* open_gaps) {
    const bool due = is_due(rounding);
    progress_.samples += is_on_grid(rounding);
    if (due) emit(progress_.t, progress_.y, progress_.has_forces || system_.ng == 0, open_gaps);
}

template <class Visit>
void Output::evaluate_inside(const Visit& visit) {
    kept_ = w.state;
    visit();
    w.state = kept_;
    system_.read(progress_.y);
    evaluate(p, w, progress_.t, system_.q, system_.v);
    w.state = kept_;
}

void Output::keep_step() {
    if (!options_.record.dense || !(stepper_.t0 + stepper_.h > stepper_.t0)) return;
    const double impacts = progress_.impact_energy;
    evaluate_inside([&] { dense_.step({progress_.numerical_energy, impacts, impacts}); });
}

void Output::keep_time_step(const DenseRecorder::StepStart& start, double impact_energy_from) {
    if (!options_.record.dense || !(progress_.t > start.t)) return;
    dense_.straight(start, progress_.t, progress_.y,
                    {progress_.numerical_energy, impact_energy_from, progress_.impact_energy});
}

void Output::emit_between(double time) {
    stepper_.make_interpolant();
    stepper_.interpolate((time - stepper_.t0) / stepper_.h, sample_);
    const bool redundant = w.now.rows.redundant;
    if (redundant) choice_ = w.now.rows;
    if (!w.now.rows.blocks.empty()) {
        system_.read(sample_);
        project(p, w, time, system_.q, system_.v);
        system_.write(sample_);
    }
    if (!w.now.rows.blocks.empty() || options_.record.evaluates() || p.constraints > 0) {
        progress_.configured_t = time;
        progress_.configured_y.head(system_.ns) = sample_.head(system_.ns);
    }
    reset_slip_directions(w);
    emit(time, sample_, false);
    if (redundant) choose_as_before(time);
}

// Restore the run's choice of rows. A sample chooses rows that are long at its own state.
void Output::choose_as_before(double time) {
    const bool same = choice_.active == w.now.rows.active;
    static_cast<RowChoice&>(w.now.rows) = choice_;
    if (same) return;
    system_.read(sample_);
    configure(p, w, time, system_.q, system_.v);
}

void Output::inside_step(std::optional<double> between) {
    const double end = progress_.t - same_time(progress_.t);
    const auto due = [&] { return options_.output_dt > 0.0 && next() < end; };
    if (between && !(*between < end)) between.reset();
    if (!between && !due()) return;
    const auto emit_samples = [&] {
        while (due()) {
            if (between && *between < next()) {
                emit_between(*between);
                between.reset();
            }
            emit_between(next());
            ++progress_.samples;
        }
        if (between) emit_between(*between);
    };
    if (!system_.has_events()) return emit_samples();
    evaluate_inside(emit_samples);  // modes and directions of slip follow from the evaluation at the step's end
    configured_now();
}

}  // namespace pn
