// What a run leaves behind: samples, events, counters.
#pragma once

#include <cstdint>
#include <exception>
#include <optional>
#include <string>
#include <vector>

#include "dynamics/split.hpp"
#include "run/system.hpp"

namespace pn {

struct Event {
    double time;
    enum class Kind { stick, slip, reverse, pull, chatter } kind;
    int element;
};

struct Recording {
    std::vector<double> t, q, v, violation, violation_rate;
    std::vector<double> a, F_ideal, F_nonideal, lam, lam_ideal, energy, power, z;
    std::vector<std::int8_t> modes;
    std::vector<Event> events;
    long steps = 0, rejected = 0;
    std::optional<Failure> failure;
    std::exception_ptr error;  // what a user function raised
};

struct RecordOptions {
    bool a = false, forces = false, energy = false, power = false;
    bool evaluates() const { return a || forces || energy || power; }
};

class Recorder {
public:
    Recorder(System& system, const RecordOptions& options, Recording& out)
        : p(system.p), w(system.w), system(system), options(options), out(out) {}
    // Room for so many samples.
    void reserve(size_t samples);
    // The state at t; moved_energy was moved by projection so far. The workspace is evaluated there when `evaluated`, and
    // left so where anything of that is recorded.
    void sample(double t, const VecX& y, double moved_energy, bool evaluated);

private:
    const Program& p;
    Workspace& w;
    System& system;
    RecordOptions options;
    Recording& out;
    VecX power_;
    Split split_;
};

}  // namespace pn
