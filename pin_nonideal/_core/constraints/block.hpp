// A constraint or a direction of friction, with the position of its rows among the rows of the scene.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "constraints/row_type.hpp"
#include "math/zeroed.hpp"

namespace pn {

// Dofs on which the rows of a block act.
struct DofSupport {
    std::vector<int> dofs;    // dofs of the scaled rows, descending and closed under ancestors
    std::vector<int> parent;  // index in dofs of each dof's parent, or -1
    struct Entry { int place, dof; double sign; };
    std::vector<Entry> entries;  // entries of A that may be nonzero, for a geometric kind
    bool deep = false;           // some dofs belong to a deep tree
};
using SharedSupports = std::map<std::pair<int, int>, std::shared_ptr<const DofSupport>>;  // by both bodies

struct Block {
    std::string name;
    Kind kind;
    int joint1 = 0, joint2 = 0;    // bodies of a geometric kind
    int dof = -1;                  // first dof, if each row is a dof itself
    int total = 0;                 // rows of the description
    std::vector<int> kept;         // rows that act
    std::vector<char> holonomic;   // per kept row
    bool comparable_rows = false;  // rows are components of one vector with one unit
    bool affine_rate = true;       // the rate is A(q, t) v + phi_t (a user's rate may depend on v otherwise)
    int user_row = 0;              // first row in the user's numbering
    int row = 0;                   // first row among the kept rows of the scene
    int offset = 0;                // first of its support().size() x kept.size() entries in Evaluation::A and ::B
    std::shared_ptr<const DofSupport> acts_on;  // set by lay_out

    Block() = default;
    // Create a block that keeps all rows.
    Block(std::string its_name, Kind what);
    const std::vector<int>& support() const { return acts_on->dofs; }
    const std::vector<int>& parent() const { return acts_on->parent; }
    const std::vector<DofSupport::Entry>& entries() const { return acts_on->entries; }
    bool is_deep() const { return acts_on->deep; }
    // Compute the support of the block, and flags of the kept rows. Blocks between the same two bodies share a support.
    void lay_out(const Mechanism& m, SharedSupports& shared);
};

// Entries of A or B, per block.
using RowEntries = ZeroedVector<double>;

// Values of the rows of all blocks. A block has storage from its first use on: most contacts of many shapes never come
// near.
class BlockValues {
public:
    void resize(const std::vector<Block>& blocks, int nv);
    RowValues& operator[](size_t block) { return known_[block] ? *known_[block] : allocate(block); }
    const RowValues& operator[](size_t block) const { return known_[block] ? *known_[block] : allocate(block); }
    bool has_storage(size_t block) const { return known_[block] != nullptr; }
    const RowStorage& storage(size_t block) const { return storage_[block]; }

private:
    RowValues& allocate(size_t block) const;

    std::vector<RowStorage> storage_;
    mutable std::vector<std::unique_ptr<RowValues>> known_;
    int nv_ = 0;
};

// Fill A on the block's support from the wrenches or the dense rows, dof-major.
void fill_A(const Block& block, const Mechanism& m, const Terms& terms, const RowValues& values, double* A);
// Compute B = A R^-T on the support, that is B^T = D^-1/2 L^-T A^T. Deep trees use sweeps of the rows' wrenches.
void scale_rows(const Mechanism& m, Terms& terms, const Block& block, const RowValues& values, const double* A,
                double* B);

// Compute y += B^T lam and r = B x, with lam and r per kept row of the scene. With the array A in place of B, the functions
// multiply by A.
void add_transpose(const Block& block, const RowEntries& B, const VecX& lam, VecX& y);
void multiply(const Block& block, const RowEntries& B, const VecX& x, VecX& r);

// Compute force += A^T f, for a force f along the rows of a block.
void add_along(const Block& block, const RowEntries& rows, const Vec3& f, VecX& force);
// Compute y += A^T lam for the rows of a block. For deep trees, `body` takes the wrenches on the bodies instead.
void add_transpose(const Block& block, const Mechanism& m, const Terms& terms, const RowValues& values,
                   const RowEntries& A, const VecX& lam, VecX& y, std::vector<Force>& body);
// Add a unit wrench times its size to the force on body 1, and subtract it from that on body 2, about their reference
// points.
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
