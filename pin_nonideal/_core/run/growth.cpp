#include "run/growth.hpp"

#include <algorithm>
#include <cmath>

namespace pn {

namespace {

// Speeds below this [rad/s or m/s] are any motion's; from there on every decade is kept in mind.
constexpr double least_speed = 1.0, decade = 10.0;
// Decades of a growth, in two halves: under a force that is constant, or a polynomial of time, the second takes much
// longer than the first, as the first does in a fall and in what a singular position or a force that grows with a power of
// the speed throws away, whose steps end by themselves.
constexpr size_t half = 3;
constexpr double as_fast = 0.8, much_faster = 100.0;

}  // namespace

GrowthGuard::GrowthGuard(System& system, Progress& progress, const Options& options)
    : system_(system), progress_(progress), options_(options) {}

void GrowthGuard::look() {
    const double speed = progress_.y.segment(system_.nq, system_.nv).cwiseAbs().maxCoeff();
    std::vector<double>& speeds = progress_.growth_speeds;
    const double next = speeds.empty() ? least_speed : decade * speeds.back();
    if (!(speed >= next)) return;
    speeds.push_back(speed);
    progress_.growth_times.push_back(progress_.t);
    if (options_.max_steps == 0) judge();
}

void GrowthGuard::judge() {
    const std::vector<double>&speeds = progress_.growth_speeds, &times = progress_.growth_times;
    if (speeds.size() <= 2 * half) return;
    const size_t last = speeds.size() - 1;
    const auto rate = [&](size_t k) { return std::log(speeds[k] / speeds[k - half]) / (times[k] - times[k - half]); };
    const double before = rate(last - half), now = rate(last);
    if (!(now > as_fast * before && now < much_faster * before)) return;
    int dof = 0;
    progress_.y.segment(system_.nq, system_.nv).cwiseAbs().maxCoeff(&dof);
    throw Failure(Failure::Kind::growing, progress_.t, {dof, largest_source()}, now);
}

// 0 of the actuation, 1 of the given forces, 2 of the laws.
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
