// Generalized forces of the laws that act. Thousands of contacts have a law each, and few of them slip.
#pragma once

#include <vector>

#include "math/spatial.hpp"

namespace pn {

class LawForceList {
public:
    void resize(size_t laws, int nv) {
        place_.assign(laws, -1);
        acting_.clear();
        zero_ = VecX::Zero(nv);
    }
    // Laws with a force, in the order of their first uses.
    const std::vector<int>& acting() const { return acting_; }
    void clear() {
        for (int law : acting_) place_[law] = -1;
        acting_.clear();
    }
    const VecX& of(int law) const { return place_[law] < 0 ? zero_ : force_[place_[law]]; }
    // Return the force of a law to change it. It begins as zero.
    VecX& operator[](int law) {
        if (place_[law] < 0) {
            place_[law] = static_cast<int>(acting_.size());
            acting_.push_back(law);
            if (force_.size() < acting_.size()) force_.push_back(zero_);
            else force_[place_[law]] = zero_;
        }
        return force_[place_[law]];
    }

private:
    std::vector<int> place_, acting_;  // per law: index of its force, -1 without one
    std::vector<VecX> force_;
    VecX zero_;
};

}  // namespace pn
