// The rows of contacts that touch, free to move: what forces along their normals and directions of slip do together.
#pragma once

#include "dynamics/workspace.hpp"
#include "complementarity/cone/problem.hpp"

namespace pn {

// Contacts that touch are rows that move but hold nothing, and without friction; `touching` by gap.
void free_contacts(const Program& p, Workspace& w, const std::vector<char>& touching);
// The same, with the motion at (t, q, v) then.
void release_contacts(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v,
                      const std::vector<char>& touching);

// Rows of some contacts, each its normal and then its directions of slip: what forces along them do, and how fast they
// move.
struct ContactRows {
    const Program& p;
    Workspace& w;
    const std::vector<int>& gaps;
    std::vector<ConeElement> cones;
    std::vector<int> first;  // row of each
    MatX W, response;        // of the rows' velocities, and of v, to a unit of each force or percussion
    VecX velocity;           // of the rows

    // Of these gaps, which are free; of their normals alone where they do not rub.
    ContactRows(const Program& p, Workspace& w, const std::vector<int>& gaps, bool rub = true);

    // Calls act(row of W, block, kept row of it).
    template <class Act>
    void each_row(const Act& act) const {
        for (size_t i = 0; i < gaps.size(); ++i) {
            const Gap& gap = p.gaps[gaps[i]];
            act(first[i], gap.block, 0);
            for (int k = 0; k + 1 < cones[i].dim; ++k) act(first[i] + 1 + k, p.frictions[gap.sliding].block, k);
        }
    }

    // What a change of v adds to the velocities of the rows.
    VecX change(const VecX& dv) const;

    auto of(const VecX& x, size_t i) const { return x.segment(first[i], cones[i].dim); }

private:
    void respond();
};

}  // namespace pn
