// What a run leaves behind: samples, events, counters.
#pragma once

#include <cstdint>
#include <exception>
#include <optional>
#include <string>
#include <vector>

#include "dynamics/law_forces.hpp"
#include "dynamics/split.hpp"
#include "run/system.hpp"

namespace pn {

struct Event {
    double time;
    enum class Kind { stick, slip, reverse, pull, chatter, several } kind;
    int element;  // of friction; of a pull the block of the contact
};

// All kinds in order, as Python names them.
struct EventKind {
    Event::Kind kind;
    const char *name, *meaning;
};
constexpr EventKind event_kinds[] = {
    {Event::Kind::stick, "stick", "an element comes to rest"},
    {Event::Kind::slip, "slip", "what stuck gives way"},
    {Event::Kind::reverse, "reverse", "slip turns round"},
    {Event::Kind::pull, "pull", "the normal force of a contact turns negative"},
    {Event::Kind::chatter, "chatter", "a cluster of events is bridged by time stepping"},
    {Event::Kind::several, "several", "from here on the laws allow other motions too"},
};

struct Recording {
    std::vector<double> t, q, v, violation, violation_rate;
    std::vector<double> a, F_ideal, F_nonideal, lam, lam_ideal, energy, power, z;
    // Of each law on the dofs that it acts on, law by law; of each element; of each joint, then of each block that
    // reaction_blocks tells, [force; moment] in its own axes and in world axes.
    std::vector<double> law_forces, limits, reactions;
    std::vector<std::int8_t> modes;
    std::vector<Event> events;
    long steps = 0, rejected = 0;
    std::optional<Failure> failure;
    std::exception_ptr error;  // what a user function raised
};

struct RecordOptions {
    bool a = false, forces = false, energy = false, power = false, laws = false, reactions = false;
    bool evaluates() const { return a || forces || energy || power || laws || reactions; }
};

class Recorder {
public:
    Recorder(System& system, const RecordOptions& options, Recording& out)
        : p(system.p), w(system.w), system(system), options(options), out(out) {
        if (options.laws) supports_ = law_supports(p);
    }
    // Room for so many samples.
    void reserve(size_t samples);
    // The state at t; moved_energy was moved by projection so far. The workspace is evaluated there when `evaluated`, and
    // left so where anything of that is recorded.
    void sample(double t, const VecX& y, double moved_energy, bool evaluated);

private:
    void record_laws(double t);
    void record_reactions();

    const Program& p;
    Workspace& w;
    System& system;
    RecordOptions options;
    Recording& out;
    VecX power_;
    Split split_;
    std::vector<std::vector<int>> supports_;  // of the laws
};

// Constraints and contacts that act between two frames, and so carry a wrench.
std::vector<int> reaction_blocks(const Program& p);

}  // namespace pn
