#include "run/whole_run.hpp"

#include "run/simulation.hpp"

namespace pn {

void simulate(const Program& p, Workspace& w, const VecX& q0, const VecX& v0, const Options& options, Recording& out) {
    Simulation simulation(p, w, options, out);
    simulation.watch_evaluations();
    record_end(out, [&] {
        simulation.start(q0, v0);
        simulation.run();
    });
}

void resume(const Program& p, Workspace& w, const std::string& state, const Options& options, Recording& out) {
    Simulation simulation(p, w, options, out);
    simulation.watch_evaluations();
    simulation.restore(state);
    record_end(out, [&] { simulation.run(); });
}

}  // namespace pn
