#include "run/integrators/growth.hpp"

#include <algorithm>
#include <cmath>

namespace pn {

GrowthGuard::GrowthGuard(System& system, Progress& progress, const Options& options, const Recording& out)
    : system_(system), progress_(progress), options_(options), out_(out) {}

void GrowthGuard::check_step() {
    const double speed = progress_.y.segment(system_.nq, system_.nv).cwiseAbs().maxCoeff();
    std::vector<double>& speeds = progress_.growth_speeds;
    const double next = speeds.empty() ? parameters.min_recorded_speed : parameters.decade * speeds.back();
    if (!(speed >= next)) return;
    speeds.push_back(speed);
    progress_.growth_times.push_back(progress_.t);
    progress_.growth_steps.push_back(out_.steps);
    if (options_.max_steps == 0) judge();
}

double GrowthGuard::growth(size_t k) const {
    const std::vector<double>&speeds = progress_.growth_speeds, &times = progress_.growth_times;
    return std::log(speeds[k] / speeds[k - parameters.half]) / (times[k] - times[k - parameters.half]);
}

bool GrowthGuard::is_exponential() const {
    const size_t last = progress_.growth_speeds.size() - 1;
    if (last < 2 * parameters.half) return false;
    const double before = growth(last - parameters.half), now = growth(last);
    return now > parameters.as_fast * before && now < parameters.much_faster * before;
}

bool GrowthGuard::is_costly() const {
    const std::vector<double>& times = progress_.growth_times;
    const std::vector<long>& steps = progress_.growth_steps;
    const size_t last = times.size() - 1;
    if (last < parameters.half + 2 || steps[last] - steps[last - 1] < parameters.min_decade_steps) return false;
    const double before = times[last - 2] - times[last - 3], now = times[last] - times[last - 1];
    return before < now && now < parameters.longer * parameters.longer * before;
}

void GrowthGuard::judge() {
    const size_t last = progress_.growth_speeds.size() - 1;
    const bool impossible = !options_.method.adaptive() &&
                            progress_.growth_speeds.back() > parameters.impossible_speed && last >= parameters.half;
    if (!impossible && !is_exponential() && !is_costly()) return;
    const double rate = growth(last);
    if (!options_.method.adaptive() && rate * options_.dt > parameters.growth_in_step) {
        if (impossible) throw Failure(Failure::Kind::not_finite, progress_.t);
        return;
    }
    int dof = 0;
    progress_.y.segment(system_.nq, system_.nv).cwiseAbs().maxCoeff(&dof);
    throw Failure(Failure::Kind::growing, progress_.t, {dof, largest_source()}, rate);
}

// Return the source of the largest power: 0 actuation, 1 applied forces, 2 laws.
int GrowthGuard::largest_source() const {
    const Evaluation& now = system_.w.now;
    const VecX speed = progress_.y.segment(system_.nq, system_.nv).cwiseAbs();
    int largest = 0;
    double most = 0.0;
    for (int source = 0; source < 3; ++source) {
        const VecX& force = source == 0 ? now.tau : source == 1 ? now.external : now.C;
        const double power = force.cwiseAbs().dot(speed);
        if (!(power > most)) continue;
        largest = source;
        most = power;
    }
    return largest;
}

}  // namespace pn
