// Loads of redundant contacts at rest, as solutions and records report them.
#pragma once

#include "dynamics/reactions.hpp"

namespace pn {

// While it exists, the multipliers of redundant contacts that all stick are the shortest ones within Coulomb's cones that
// exert the same force. The minimum-norm multipliers alone may leave a cone, although other multipliers hold the
// contacts at rest. The multipliers do not change if a contact slides, because its friction follows the minimum-norm
// load, or if none within the cones are found.
class ReportedLoads {
public:
    ReportedLoads(const Program& p, Workspace& w);
    ~ReportedLoads();
    ReportedLoads(const ReportedLoads&) = delete;
    ReportedLoads& operator=(const ReportedLoads&) = delete;

private:
    Workspace& w_;
    VecX least_norm_;  // empty if the multipliers stayed
};

}  // namespace pn
