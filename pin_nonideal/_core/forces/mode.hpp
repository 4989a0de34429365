// Modes of friction elements.
#pragma once

#include <vector>

namespace pn {

// Stick-slip mode of a friction element: slip in one direction (+1 or -1, +1 for several directions), sticking, or
// unloaded. An unloaded element exerts no friction, because its contact is open or its mode is still being determined.
// The value of a slip mode is the sign of the slip.
enum Mode : signed char { slip_minus = -1, sticking = 0, slip_plus = 1, unloaded = 2 };
inline bool slips(Mode mode) { return mode == slip_plus || mode == slip_minus; }

struct Program;
struct Workspace;
class Archive;

// Modes of all elements. Every function may read the modes, but only set_modes and archives change the modes.
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
