// Results of a run: samples, events, counters.
#pragma once

#include <cstdint>
#include <exception>
#include <optional>
#include <string>
#include <vector>

#include "dynamics/law_forces.hpp"
#include "dynamics/force_decomposition.hpp"
#include "run/output/dense_output.hpp"
#include "run/integrators/system.hpp"

namespace pn {

struct Event {
    enum class Kind {
        stick, slip, reverse, pull, chatter, several, paradox, user, saturate, desaturate, jump, impact, touch_down,
        lift_off, relaxed
    };
    double time;
    Kind kind;
    int element;  // friction element, block of a contact or prescribed motion, user function, or dof of a drive
    // Impact: components along the normal and the slip directions. Prescribed motion: first component only.
    Vec3 impulse = Vec3::Zero();
    double energy_change = 0.0;
    VecX v_minus = {}, v_plus = {};
    double miss = 0.0;  // relaxed: velocity [m/s or rad/s] by which the laws are missed
    static bool of_drive(Kind kind) { return kind == Kind::saturate || kind == Kind::desaturate; }
    static bool of_contact(Kind kind) { return kind == Kind::pull || kind >= Kind::impact; }
};

// All kinds in order, with their Python names.
struct EventKind {
    Event::Kind kind;
    const char *name, *meaning;
};
constexpr EventKind event_kinds[] = {
    {Event::Kind::stick, "stick", "an element comes to rest"},
    {Event::Kind::slip, "slip", "a sticking element begins to slip"},
    {Event::Kind::reverse, "reverse", "the slip velocity reverses"},
    {Event::Kind::pull, "pull", "the normal force of a contact turns negative"},
    {Event::Kind::chatter, "chatter", "a cluster of events is bridged by time stepping"},
    {Event::Kind::several, "several", "the laws also allow other motions from this time on"},
    {Event::Kind::paradox, "paradox", "time stepping continues from this time on through modes that allow no motion"},
    {Event::Kind::user, "user", "a function of the user crosses zero"},
    {Event::Kind::saturate, "saturate", "the torque of a drive reaches its effort limit"},
    {Event::Kind::desaturate, "desaturate", "the torque of a drive falls below its effort limit"},
    {Event::Kind::jump, "jump", "the rate of a prescribed motion jumps, with an impulse"},
    {Event::Kind::impact, "impact", "a contact strikes, with an impulse"},
    {Event::Kind::touch_down, "touch_down", "a contact closes without an impulse, or its bouncing ends"},
    {Event::Kind::lift_off, "lift_off", "a contact opens"},
    {Event::Kind::relaxed, "relaxed", "steps violate the laws of contact from this time on, by the velocity in `miss`"},
};

struct Recording {
    std::vector<double> t, q, v, violation, violation_rate;
    std::vector<double> a, tau, F_ideal, F_nonideal, lam, lam_ideal, energy, power, z;
    // Force of each law on its dofs, and friction limit of each element. Reactions of each joint, then of each block of
    // `reaction_blocks`: force and moment in its own axes, then in world axes.
    std::vector<double> law_forces, limits, reactions;
    std::vector<double> contact_forces;  // force on the body of each contact's frame, in world axes [N]
    std::vector<std::int8_t> modes, closed;
    std::vector<Event> events;
    DenseOutput dense;
    long steps = 0, rejected = 0;
    long limited = 0;       // steps whose rounding exceeded the tolerances
    double rounding = 0.0;  // largest measured rounding error of an acceleration, relative to the largest acceleration
    std::optional<Failure> failure;
    std::exception_ptr error;  // exception of a user function
};

struct RecordOptions {
    bool a = false, forces = false, energy = false, power = false, laws = false, reactions = false, tau = false;
    bool dense = false;
    bool evaluates() const { return a || forces || energy || power || laws || reactions || tau; }
};

class Recorder {
public:
    Recorder(System& system, const RecordOptions& options, Recording& out)
        : p(system.p), w(system.w), system(system), options(options), out(out) {
        if (options.laws) supports_ = law_supports(p);
    }
    // Reserve memory for this number of samples.
    void reserve(size_t samples);
    // Energy changes so far that are not integrated as work [J].
    struct Jumps { double impacts, projection; };
    // Record the state at t. `evaluated`: the workspace is evaluated at t. Otherwise it is evaluated if the options
    // need it. `open_gaps`: gaps that are known to be open, which are not measured.
    void sample(double t, const VecX& y, const Jumps& jumps, bool evaluated, const std::vector<char>* open_gaps = nullptr);

private:
    void record_laws(double t);
    void record_reactions();
    void record_contacts();

    const Program& p;
    Workspace& w;
    System& system;
    RecordOptions options;
    Recording& out;
    VecX power_;
    Split split_;
    std::vector<std::vector<int>> supports_;  // dofs of each law
};

// Append 1 for each closed contact and 0 for each open one, in the order of their descriptions.
void append_closed(const Program& p, const Workspace& w, std::vector<std::int8_t>& to);
// Return the contacts between two frames, in the order of their descriptions.
std::vector<int> framed_contacts(const Program& p);
// Return the constraints and contacts that act between two frames, and therefore carry a wrench.
std::vector<int> reaction_blocks(const Program& p);

}  // namespace pn
