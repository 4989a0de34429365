#include "run/run_limits.hpp"

#include <cmath>

namespace pn {

void RunLimits::watch_evaluations() {
    if (!options_.tick && !(options_.max_wall > 0.0)) return;
    w.watch = [this](double time) {
        if (options_.tick) options_.tick(time);
        if (is_late()) throw EndOfRun{Failure(Failure::Kind::wall, progress_.t, {}, options_.max_wall)};
    };
}

bool RunLimits::is_late() const {
    return options_.max_wall > 0.0 && std::chrono::duration<double>(Clock::now() - start_time_).count() > options_.max_wall;
}

// Runs are saved only here, because the state between two steps is all that the next step needs.
void RunLimits::check() {
    try {
        if (options_.tick && ++ticks_ % parameters.steps_per_tick == 0) options_.tick(progress_.t);
    } catch (...) {
        save();
        throw;
    }
    if (options_.save && Clock::now() >= next_save_) save();
    if (out_.steps == parameters.early_steps && progress_.t - options_.t0 < parameters.min_progress * options_.duration)
        throw Failure(Failure::Kind::step_size, progress_.t, {}, static_cast<double>(out_.steps));
    if (options_.max_steps > 0 && out_.steps >= options_.max_steps)
        throw Failure(Failure::Kind::steps, progress_.t, {}, static_cast<double>(out_.steps));
    if (is_late()) throw Failure(Failure::Kind::wall, progress_.t, {}, options_.max_wall);
}

void RunLimits::save() {
    if (!options_.save) return;
    options_.save(to_bytes(w, progress_, out_));
    next_save_ = Clock::now() + options_.save_interval;
}

}  // namespace pn
