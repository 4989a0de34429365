// What a run does where contacts touch: they strike, what bounces too low to be integrated comes to rest, and the gaps
// that are left open are looked at for the next step.
#pragma once

#include "run/output/output.hpp"

namespace pn {

class Landing {
public:
    Landing(System& system, Progress& progress, GapWatch& watch, const Options& options, Output& output, Recording& out);

    // Impacts of contacts that touch and approach each other, until none does; whether there was one.
    bool strike(bool starts);
    // The end of bouncing behind a strike, not beyond `stop` nor the next sample; where there is none the state stays.
    void end_bouncing(double stop);
    // Widths and rates of the gaps at the state now, from which the next step starts; of a step that was followed to its
    // end the near ones.
    void remember_gaps(bool whole_step = false);

private:
    bool strike_once(bool starts);

    const Program& p;
    Workspace& w;
    System& system_;
    Progress& now_;
    GapWatch& watch_;
    const Options& options_;
    Output& output_;
    Recording& out_;
};

}  // namespace pn
