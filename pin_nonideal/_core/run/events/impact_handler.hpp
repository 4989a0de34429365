// Handling of touching contacts in a run: impacts, the end of low bouncing, and samples of the open gaps for the next
// step.
#pragma once

#include "run/output/output.hpp"

namespace pn {

struct ImpactHandlerParameters {
    // Energy gain of an impact that counts as rounding error, relative to its works.
    double gain_rounding = 1e-12;
    // Maximum number of consecutive impacts at one instant. An impact can reverse the separation of other
    // contacts.
    int max_simultaneous_impacts = 100;
};

class ImpactHandler {
public:
    using Parameters = ImpactHandlerParameters;
    static constexpr Parameters parameters{};

    ImpactHandler(System& system, Progress& progress, GapWatch& watch, const Options& options, Output& output,
                  Recording& out);

    // Apply impacts until no touching contact approaches. Return true if there was an impact.
    bool resolve_impacts(bool starts);
    // Advance to the end of bouncing after an impact, not beyond `stop` or the next sample. Without low bouncing the
    // state stays.
    void end_bouncing(double stop);
    // Sample widths and rates of the gaps at the current state, from which the next step starts. `whole_step`: sample
    // only monitored gaps, after a step that was followed to its end.
    void remember_gaps(bool whole_step = false);

private:
    bool resolve_one_impact(bool starts);

    const Program& p;
    Workspace& w;
    System& system_;
    Progress& progress_;
    GapWatch& watch_;
    const Options& options_;
    Output& output_;
    Recording& out_;
};

}  // namespace pn
