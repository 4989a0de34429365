// Modes of frictional elements.
#pragma once

#include <vector>

namespace pn {

// An element slips one way (+1, -1; +1 for several directions), sticks, or carries no friction at all: that of an open
// contact, or while the modes are being sought.
// Numbers, so that the sign of a slip is the mode.
enum Mode : signed char { slip_minus = -1, sticking = 0, slip_plus = 1, unloaded = 2 };
inline bool slips(Mode mode) { return mode == slip_plus || mode == slip_minus; }

struct Program;
struct Workspace;
class Archive;

// Those of all elements, to be read by all and changed by set_alone.
class Modes {
public:
    explicit Modes(size_t elements = 0) : values_(elements, slip_plus) {}
    Mode operator[](size_t element) const { return values_[element]; }
    operator const std::vector<Mode>&() const { return values_; }
    auto begin() const { return values_.begin(); }
    auto end() const { return values_.end(); }

private:
    std::vector<Mode> values_;
    friend void set_modes(const Program& p, Workspace& w, const std::vector<Mode>& modes);
    friend void fields(Archive& a, Modes& x);
};

}  // namespace pn
