// A constraint, or a direction of friction, with its place among the rows of the scene.
#pragma once

#include <string>
#include <vector>

#include "constraints/row_type.hpp"

namespace pn {

struct Block {
    std::string name;
    Kind kind;
    int joint1 = 0, joint2 = 0;    // bodies of a geometric kind
    int dof = -1;                  // where each row is a dof itself: the first of them
    int total = 0;                 // rows of the description
    std::vector<int> kept;         // rows that act
    std::vector<char> holonomic;   // of the kept rows
    bool comparable_rows = false;  // rows are components of one vector, of one unit
    bool affine_rate = true;       // its rate is A(q, t) v + phi_t; a user's own may be another function of v
    int user_row = 0;              // first row in the user's numbering
    int row = 0;                   // first row among the kept rows of the scene
    std::vector<int> support;      // dofs that the scaled rows reach, descending and closed under ancestors
    std::vector<int> parent;       // place in support of each dof's parent, or -1
    struct Entry { int place, dof; double sign; };
    std::vector<Entry> entries;    // where A of a geometric kind may differ from zero
    bool deep = false;             // some of them belong to a deep tree
    int offset = 0;                // of its support.size() x kept.size() entries in Evaluation::A and ::B

    Block() = default;
    // All its rows act.
    Block(std::string its_name, Kind what);
    // Support and entries, and what follows from the rows that are kept.
    void lay_out(const Mechanism& m);
};

// A on the block's support from the wrenches or the dense rows; dof-major.
void fill_A(const Block& block, const Mechanism& m, const Terms& terms, const RowValues& values, double* A);
// B = A R^-T on it, that is B^T = D^-1/2 L^-T A^T, or in deep trees sweeps of the rows' wrenches.
void scale_rows(const Mechanism& m, Terms& terms, const Block& block, const RowValues& values, const double* A,
                double* B);

// y += B^T lam and r = B x, with lam and r by kept row of the scene; the same functions serve A with the array A.
void add_transpose(const Block& block, const std::vector<double>& B, const VecX& lam, VecX& y);
void multiply(const Block& block, const std::vector<double>& B, const VecX& x, VecX& r);

// force += A^T f for a force along the rows of a block.
void add_along(const Block& block, const std::vector<double>& rows, const Vec3& f, VecX& force);
// y += A^T lam for the rows of a block, what acts on bodies of deep trees as forces on them into `body`.
void add_transpose(const Block& block, const Mechanism& m, const Terms& terms, const RowValues& values,
                   const std::vector<double>& A, const VecX& lam, VecX& y, std::vector<Force>& body);
// Adds a unit wrench times its size to the forces on the two bodies of a block, about their reference points.
inline void add_wrench(const Block& block, const Terms& terms, const Wrench& unit, double size,
                       std::vector<Force>& body) {
    for (int side = 0; side < 2; ++side) {
        const int joint = side == 0 ? block.joint1 : block.joint2;
        if (joint == 0) continue;
        const double s = side == 0 ? size : -size;
        const Vec3 force = s * unit.force;
        body[joint] += Force{force, s * unit.couple + (unit.point - terms.body[joint].ref).cross(force)};
    }
}

}  // namespace pn
