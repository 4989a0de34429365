// Modes of frictional elements.
#pragma once

#include <vector>

namespace pn {

// An element slips one way (+1, -1; +1 for several directions), sticks, or, while the modes are being sought, carries no
// friction at all.
constexpr signed char sticking = 0, unloaded = 2;
inline bool slips(signed char mode) { return mode == 1 || mode == -1; }

struct Program;
struct Workspace;
class Archive;

// Those of all elements, to be read by all and changed by set_modes (modes.hpp) alone.
class Modes {
public:
    explicit Modes(size_t elements = 0) : values_(elements, 1) {}
    signed char operator[](size_t element) const { return values_[element]; }
    operator const std::vector<signed char>&() const { return values_; }
    auto begin() const { return values_.begin(); }
    auto end() const { return values_.end(); }

private:
    std::vector<signed char> values_;
    friend void set_modes(const Program& p, Workspace& w, const std::vector<signed char>& modes);
    friend void fields(Archive& a, Modes& x);
};

}  // namespace pn
