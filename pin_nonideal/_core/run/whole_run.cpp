#include "run/whole_run.hpp"

#include <exception>

#include "run/simulation.hpp"

namespace pn {

// Call `steps`, and store the failure or exception that stops them.
template <class Steps>
static void keep_what_stops(Recording& out, Steps steps) {
    try {
        steps();
    } catch (const Failure& failure) {
        out.failure = failure;
    } catch (const EndOfRun& end) {
        out.failure = end.failure;
    } catch (...) {
        out.error = std::current_exception();
    }
}

void simulate(const Program& p, Workspace& w, const VecX& q0, const VecX& v0, const Options& options, Recording& out) {
    Simulation simulation(p, w, options, out);
    simulation.watch_evaluations();
    keep_what_stops(out, [&] {
        simulation.start(q0, v0);
        simulation.run();
    });
}

void resume(const Program& p, Workspace& w, const std::string& state, const Options& options, Recording& out) {
    Simulation simulation(p, w, options, out);
    simulation.watch_evaluations();
    simulation.restore(state);
    keep_what_stops(out, [&] { simulation.run(); });
}

}  // namespace pn
