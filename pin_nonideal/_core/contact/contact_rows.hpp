// Rows of touching contacts without constraint: coupled response to normal and friction forces.
#pragma once

#include "dynamics/workspace.hpp"
#include "complementarity/cone/problem.hpp"

namespace pn {

// Evaluate touching contacts as rows without constraint forces and friction. `touching` is per gap.
void free_contacts(const Program& p, Workspace& w, const std::vector<char>& touching);
// Evaluate these rows and compute the motion at (t, q, v). The second form keeps the friction of elements that slip in
// `modes`.
void release_contacts(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v,
                      const std::vector<char>& touching);
void release_contacts(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v,
                      const std::vector<char>& touching, const std::vector<Mode>& modes);

// Rows of some contacts, each with its normal and then its slip directions, and of other friction elements: response to
// forces along them, and velocities.
struct ContactRows {
    const Program& p;
    Workspace& w;
    const std::vector<int>& gaps;
    std::vector<int> others;         // friction elements that belong to no contact
    std::vector<ConeElement> cones;  // cones of the contacts, then of the other elements
    std::vector<int> first;          // first row of each
    MatX W, response;        // velocities of the rows, and v, for a unit of each force or impulse
    VecX velocity;           // velocities of the rows

    // Set up the rows of these unconstrained gaps and elements. Without `rub`, only the normals of the gaps.
    ContactRows(const Program& p, Workspace& w, const std::vector<int>& gaps, bool rub = true,
                std::vector<int> others = {});

    // Friction element of a cone, or -1.
    int element(size_t cone) const {
        return cone < gaps.size() ? p.gaps[gaps[cone]].sliding : others[cone - gaps.size()];
    }

    // Call act(row of W, block, kept row of the block).
    template <class Act>
    void each_row(const Act& act) const {
        for (size_t i = 0; i < gaps.size(); ++i) {
            const Gap& gap = p.gaps[gaps[i]];
            act(first[i], gap.block, 0);
            for (int k = 0; k + 1 < cones[i].dim; ++k) act(first[i] + 1 + k, p.frictions[gap.sliding].block, k);
        }
        for (size_t i = gaps.size(); i < cones.size(); ++i)
            for (int k = 0; k < cones[i].dim; ++k) act(first[i] + k, p.frictions[element(i)].block, k);
    }

    // Change of the rows' velocities due to a change of v.
    VecX change(const VecX& dv) const;

    auto of(const VecX& x, size_t i) const { return x.segment(first[i], cones[i].dim); }

private:
    void respond();
};

}  // namespace pn
