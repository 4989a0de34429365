#include "run/events/warnings.hpp"

#include "dynamics/evaluation.hpp"
#include "dynamics/reactions.hpp"

namespace pn {

// Tolerance of the first instant with several motions, relative to the step.
constexpr double several_width = 1e-12;

Warnings::Warnings(System& system, Stepper& stepper, Progress& progress, Recording& out)
    : p(system.p), w(system.w), system_(system), stepper_(stepper), progress_(progress), out_(out),
      sample_(VecX::Zero(system.ny)) {}

void Warnings::record_pulls(const std::optional<FoundEvent>& event) {
    const int n = static_cast<int>(p.contacts.size());
    std::vector<char> is_reported(n, 0), now(n, 0);
    const auto add_tension = [&](int i, bool located) {
        const PullMargin found = contact_pull_margin(p, w, i);
        for (int j : found.sharing) is_reported[j] = 1;
        if (!found.must_pull && !located) return;
        for (int j : found.sharing) now[j] = progress_.in_tension[j];
        for (int j : found.pulling) now[j] = 1;
    };
    if (event && event->kind == FoundEvent::Kind::pull) add_tension(event->index, true);
    for (int i = 0; i < n; ++i)
        if (!is_reported[i] && normal_force(p, w, i) < 0.0) add_tension(i, false);
    for (int i = 0; i < n; ++i)
        if (now[i] && !progress_.in_tension[i]) out_.events.push_back({progress_.t, Event::Kind::pull, p.contacts[i]});
    progress_.in_tension = now;
}

std::optional<double> Warnings::record_several(bool after_step) {
    const int element = w.now.several_element;
    const double at = after_step && w.state.unique == Uniqueness::several ? last_unique() : progress_.t;
    out_.events.push_back({at, w.now.no_motion ? Event::Kind::paradox : Event::Kind::several, element});
    return at;
}

// Return the first instant with several motions, by bisection of the step just taken on its interpolant. The workspace
// is restored.
double Warnings::last_unique() {
    const RunState kept = w.state;
    stepper_.make_interpolant();
    double low = 0.0, high = 1.0;
    while (high - low > several_width) {
        const double mid = 0.5 * (low + high);
        stepper_.interpolate(mid, sample_);
        system_.read(sample_);
        w.state.steps_since = undecided_steps;
        evaluate(p, w, stepper_.t0 + mid * stepper_.h, system_.q, system_.v);
        (w.state.unique == Uniqueness::several ? high : low) = mid;
    }
    w.state = kept;
    system_.read(progress_.y);
    evaluate(p, w, progress_.t, system_.q, system_.v);
    return stepper_.t0 + high * stepper_.h;
}

}  // namespace pn
