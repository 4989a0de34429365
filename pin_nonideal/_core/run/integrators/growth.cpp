#include "run/integrators/growth.hpp"

#include <algorithm>
#include <cmath>

namespace pn {

namespace {

// Speed [rad/s or m/s] from which every decade is recorded. Smaller speeds are ordinary.
constexpr double min_recorded_speed = 1.0, decade = 10.0;
// Decades in each half of a growth. Exponential growth takes equal time for both halves. Under a constant force, or in
// a motion polynomial in time, the second half takes much longer. It takes much less near a singular position, or under
// a force that grows with a power of the speed. Such runs end by themselves as their steps shrink.
constexpr size_t half = 3;
constexpr double as_fast = 0.8, much_faster = 100.0;
// A chaotic motion with a source of energy grows by a power of time. Its last decade takes at least `min_decade_steps`.
// Each decade takes longer than the one before, on average less than `longer` times as long. Under a constant force a
// decade takes ten times as long, and near a singular position it is shorter.
constexpr long min_decade_steps = 1000;
constexpr double longer = 5.0;
// Maximum growth in one fixed step that is attributed to the motion. Faster growth comes from the method: the step is
// too long, and the motion overflows.
constexpr double growth_in_step = 0.1;
// Speed [rad/s or m/s] that no mechanism has. A run of fixed steps ends at this speed, before its motion overflows.
constexpr double impossible_speed = 1e12;

}  // namespace

GrowthGuard::GrowthGuard(System& system, Progress& progress, const Options& options, const Recording& out)
    : system_(system), progress_(progress), options_(options), out_(out) {}

void GrowthGuard::look() {
    const double speed = progress_.y.segment(system_.nq, system_.nv).cwiseAbs().maxCoeff();
    std::vector<double>& speeds = progress_.growth_speeds;
    const double next = speeds.empty() ? min_recorded_speed : decade * speeds.back();
    if (!(speed >= next)) return;
    speeds.push_back(speed);
    progress_.growth_times.push_back(progress_.t);
    progress_.growth_steps.push_back(out_.steps);
    if (options_.max_steps == 0) judge();
}

double GrowthGuard::growth(size_t k) const {
    const std::vector<double>&speeds = progress_.growth_speeds, &times = progress_.growth_times;
    return std::log(speeds[k] / speeds[k - half]) / (times[k] - times[k - half]);
}

bool GrowthGuard::is_exponential() const {
    const size_t last = progress_.growth_speeds.size() - 1;
    if (last < 2 * half) return false;
    const double before = growth(last - half), now = growth(last);
    return now > as_fast * before && now < much_faster * before;
}

bool GrowthGuard::is_costly() const {
    const std::vector<double>& times = progress_.growth_times;
    const std::vector<long>& steps = progress_.growth_steps;
    const size_t last = times.size() - 1;
    if (last < half + 2 || steps[last] - steps[last - 1] < min_decade_steps) return false;
    const double before = times[last - 2] - times[last - 3], now = times[last] - times[last - 1];
    return before < now && now < longer * longer * before;
}

void GrowthGuard::judge() {
    const size_t last = progress_.growth_speeds.size() - 1;
    const bool impossible =
        !options_.method.adaptive() && progress_.growth_speeds.back() > impossible_speed && last >= half;
    if (!impossible && !is_exponential() && !is_costly()) return;
    const double rate = growth(last);
    if (!options_.method.adaptive() && rate * options_.dt > growth_in_step) {
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
