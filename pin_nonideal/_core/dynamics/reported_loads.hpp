// Loads of redundant contacts at rest, as solutions and records report them.
#pragma once

#include "dynamics/reactions.hpp"

namespace pn {

struct ReportedLoadsParameters {
    // Smallest entry of a row that counts in a unit vector of multipliers that exert no force.
    double min_part = 1e-9;
    // Rows of separate trees beyond which equally compliant contacts take the place of the shortest multipliers, whose
    // cost grows with the cube of the number, to 20 ms here.
    int max_rows = 150;
    // Part of its limit by which friction may leave its cone by rounding.
    double cone_rounding = 1e-9;
};

inline constexpr ReportedLoadsParameters reported_loads_parameters{};

// While an object of this class exists, the multipliers of redundant contacts that all stick are the shortest ones within
// Coulomb's cones that exert the same force. The minimum-norm multipliers alone may leave a cone, although other multipliers
// hold the contacts at rest. The multipliers do not change if a contact slides, because its friction follows the
// minimum-norm load, or if none within the cones are found.
class ReportedLoads {
public:
    ReportedLoads(const Program& p, Workspace& w);
    ~ReportedLoads();
    ReportedLoads(const ReportedLoads&) = delete;
    ReportedLoads& operator=(const ReportedLoads&) = delete;
    // Check if the multipliers of all sticking elements are within the cones, and no joint sticks.
    bool are_in_cones() const { return in_cones_; }

private:
    Workspace& w_;
    VecX minimum_norm_;  // empty if the multipliers stayed
    bool in_cones_ = false;
};

}  // namespace pn
