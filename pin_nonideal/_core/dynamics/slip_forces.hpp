// Forces of the friction elements along their slip directions. The force of an unloaded element is zero.
#pragma once

#include <vector>

#include "forces/mode.hpp"
#include "math/spatial.hpp"

namespace pn {

// Most of the thousands of elements of a scene have no load. The elements with a force are listed.
class SlipForces {
public:
    void resize(size_t elements) {
        force_.assign(elements, Vec3::Zero());
        is_listed_.assign(elements, 0);
        listed_.clear();
    }
    size_t size() const { return force_.size(); }
    const Vec3& operator[](int element) const { return force_[element]; }
    // Return the force of an element for writing, and list the element.
    Vec3& change(int element) {
        if (!is_listed_[element]) listed_.push_back(element);
        is_listed_[element] = 1;
        return force_[element];
    }
    // Set the forces of elements without a load to zero.
    void unload(const std::vector<Mode>& modes) {
        size_t kept = 0;
        for (int e : listed_) {
            is_listed_[e] = modes[e] != unloaded;
            if (is_listed_[e]) listed_[kept++] = e;
            else force_[e] = Vec3::Zero();
        }
        listed_.resize(kept);
    }

private:
    std::vector<Vec3> force_;
    std::vector<char> is_listed_;
    std::vector<int> listed_;  // elements whose force may differ from zero
};

}  // namespace pn
