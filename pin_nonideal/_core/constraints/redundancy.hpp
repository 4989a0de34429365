// Load sharing of redundant rows, for which the motion determines only the sum of the multipliers. The multipliers have
// minimum norm, in the scale of the descriptions, among all that exert the same force.
#pragma once

#include "constraints/schur_factor.hpp"

namespace pn {

struct RedundancyParameters {
    // A dependent row is a weighted sum of independent rows. Normal equations give its weights, and their products of
    // rows square the condition number. A second pass therefore repeats the solution for the remainder of the row.
    // [Bjorck: Stability analysis of the method of seminormal equations, 1987.]
    double rounding = 1e-14;  // remainder that counts as rounding error, relative to the row
    int max_passes = 2;       // maximum passes
    // Weight of multipliers of a joint's friction relative to the constraints that carry the same load, at any scale of
    // their rows. Friction carries this fraction of the load, and its limit is checked to a few digits.
    double friction_weight = 1e-12;
};

inline constexpr RedundancyParameters redundancy_parameters{};

// Rows of all descriptions and the kept rows that represent them. Duplicate rows are removed but carry their share of
// the load.
struct DescribedRows {
    struct Row {
        int kept = -1;        // kept row that represents it (-1: nothing moves along it, and its multiplier is zero)
        double factor = 1.0;  // the row is this multiple of the kept row
        double part = 1.0;    // ratio of its minimum-norm multiplier to the multiplier of the kept row
    };
    std::vector<Row> rows;     // constraints and contacts in their order, then directions of friction
    VecX weight;               // per kept row: sum of the squared factors of the rows that it represents
    std::vector<char> yields;  // per kept row: belongs to friction that carries only loads that constraints cannot carry
    bool copied = false;       // some kept row represents several rows

    // Compute parts and weights once all rows are known.
    void finish(int kept);
    // Let the rows of a joint's friction carry only loads that constraints cannot carry.
    void yield(const Block& friction);
    // Return the multiplier of one described row from the multipliers of the kept rows.
    double share(int row, const VecX& lam) const {
        return rows[row].kept < 0 ? 0.0 : rows[row].part * lam[rows[row].kept];
    }
};

// Required rows that depend on the active rows, and their coefficients: A_dependent = W A_active. The columns of W are
// the rows in use, in the order of the envelope.
std::vector<int> dependent_rows(const RowSystem& s);
MatX dependence(const std::vector<Block>& blocks, const RowEntries& B, RowSystem& s,
                const std::vector<int>& dependent);

// Compute minimum-norm multipliers per kept row from the multipliers of the rows in use. The multiplier of a kept row is the
// total of the rows that it represents.
void share_multipliers(const std::vector<Block>& blocks, const RowEntries& B,
                       const DescribedRows& all, RowSystem& s, const VecX& lam, VecX& shared);

// Basis of the multipliers that together exert no force, with one entry per kept row. The basis is orthonormal in the norm
// of the described rows. The basis has entries for the rows in use only, which may be a small part of all rows.
class FreeMultipliers {
public:
    FreeMultipliers(const Envelope& envelope, const MatX& basis) : envelope_(envelope), basis_(basis) {}

    Eigen::Index count() const { return basis_.cols(); }
    // Multipliers of a kept row, one for each element of the basis. Zero if the row is not in use.
    VecX of_row(int row) const;
    double norm_of_row(int row) const;
    // Add the sum of the basis, weighted by z, to multipliers.
    void add(const VecX& z, VecX& lam) const;
    // Rows in use, ascending.
    std::vector<int> rows() const;

private:
    bool is_used(int row) const {
        const int at = envelope_.position[row];
        return at < envelope_.size() && envelope_.row_at[at] == row;
    }

    const Envelope& envelope_;
    const MatX& basis_;  // by position in the envelope
};
FreeMultipliers free_multipliers(const std::vector<Block>& blocks, const RowEntries& B, const DescribedRows& all,
                                 RowSystem& s);

}  // namespace pn
