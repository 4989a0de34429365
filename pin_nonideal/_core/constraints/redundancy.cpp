#include "constraints/redundancy.hpp"

#include "math/decompositions.hpp"

namespace pn {

std::vector<int> dependent_rows(const RowSystem& s) {
    std::vector<int> dependent;
    if (!s.redundant) return dependent;
    for (size_t r = 0; r < s.required.size(); ++r)
        if (s.required[r] && !s.active[r]) dependent.push_back(static_cast<int>(r));
    return dependent;
}

// Return the given rows of B, as columns.
static MatX columns_of(const std::vector<Block>& blocks, const RowEntries& B, const RowSystem& s,
                       const std::vector<int>& rows) {
    std::vector<int> column(s.scale.size(), -1);
    for (size_t k = 0; k < rows.size(); ++k) column[rows[k]] = static_cast<int>(k);
    MatX out = MatX::Zero(s.Q.rows(), static_cast<Eigen::Index>(rows.size()));
    for (int i : s.blocks) {
        const Block& block = blocks[i];
        const double* entry = B.data() + block.offset;
        for (int dof : block.support())
            for (size_t k = 0; k < block.kept.size(); ++k, ++entry)
                if (column[block.row + k] >= 0) out(dof, column[block.row + k]) = *entry;
    }
    return out;
}

MatX dependence(const std::vector<Block>& blocks, const RowEntries& B, RowSystem& s,
                const std::vector<int>& dependent) {
    const std::vector<int>& rows = s.envelope.row_at;
    const MatX used = columns_of(blocks, B, s, rows);
    MatX rest = columns_of(blocks, B, s, dependent);
    const VecX min_size = redundancy_parameters.rounding * rest.colwise().norm().transpose();
    MatX W = MatX::Zero(rest.cols(), used.cols()), weights(used.cols(), rest.cols());
    VecX product = VecX::Zero(s.scale.size()), weight = product;
    for (int pass = 0; pass < redundancy_parameters.max_passes; ++pass) {
        if ((rest.colwise().norm().transpose().array() <= min_size.array()).all()) break;
        weights.noalias() = used.transpose() * rest;
        for (Eigen::Index k = 0; k < rest.cols(); ++k) {
            for (size_t l = 0; l < rows.size(); ++l) product[rows[l]] = weights(l, k);
            solve_active_rows(s, product, weight);
            for (size_t l = 0; l < rows.size(); ++l) weights(l, k) = weight[rows[l]];
        }
        W += weights.transpose();
        rest.noalias() -= used * weights;
    }
    return W;
}

void DescribedRows::finish(int kept) {
    weight = VecX::Zero(kept);
    yields.assign(kept, 0);
    for (const Row& row : rows) {
        if (row.kept < 0) continue;
        copied |= weight[row.kept] > 0.0;
        weight[row.kept] += row.factor * row.factor;
    }
    for (Row& row : rows)
        if (row.kept >= 0) row.part = row.factor / weight[row.kept];
}

void DescribedRows::yield(const Block& friction) {
    std::fill_n(yields.begin() + friction.row, friction.kept.size(), 1);
}

// Return the inverse weights of the rows in use and of the dependent rows. All friction that yields has one factor:
// `friction_weight` divided by the largest load of constraints per unit load of such friction.
static std::pair<VecX, VecX> inverse_weights(const DescribedRows& all, const std::vector<int>& rows,
                                             const LoadSharing& sharing) {
    VecX used(rows.size()), dependent(sharing.dependent.size());
    for (size_t l = 0; l < rows.size(); ++l) used[l] = 1.0 / all.weight[rows[l]];
    for (size_t k = 0; k < sharing.dependent.size(); ++k) dependent[k] = 1.0 / all.weight[sharing.dependent[k]];
    double carried = 0.0;
    for (size_t k = 0; k < sharing.dependent.size(); ++k) {
        if (!all.yields[sharing.dependent[k]]) continue;
        double of_constraints = 0.0;
        for (size_t l = 0; l < rows.size(); ++l)
            if (!all.yields[rows[l]]) of_constraints += sharing.W(k, l) * sharing.W(k, l) * used[l];
        carried = std::max(carried, of_constraints / dependent[k]);
    }
    const double factor = (carried > 0.0 ? carried : 1.0) / redundancy_parameters.friction_weight;
    for (size_t l = 0; l < rows.size(); ++l)
        if (all.yields[rows[l]]) used[l] *= factor;
    for (size_t k = 0; k < sharing.dependent.size(); ++k)
        if (all.yields[sharing.dependent[k]]) dependent[k] *= factor;
    return {std::move(used), std::move(dependent)};
}

// Return the load sharing of the rows in use, which is computed if they have changed.
static LoadSharing& load_sharing(const std::vector<Block>& blocks, const RowEntries& B, const DescribedRows& all,
                                 RowSystem& s) {
    LoadSharing& sharing = s.sharing;
    if (sharing.factorization == s.factorization && sharing.active == s.active && sharing.required == s.required)
        return sharing;
    sharing = {s.factorization, s.active, s.required, dependent_rows(s), {}, {}, {}, false};
    const std::vector<int>& rows = s.envelope.row_at;
    sharing.W = dependence(blocks, B, s, sharing.dependent);
    // With weights g and x + W^T y = lam, sum(x^2/g) + sum(y^2/g) is minimal if (1/g + W (1/g) W^T) y = W (1/g) lam.
    const auto [used, dependent] = inverse_weights(all, rows, sharing);
    const MatX weighted = sharing.W * used.asDiagonal();
    MatX S = weighted * sharing.W.transpose();
    S.diagonal() += dependent;
    sharing.taken = solve_semidefinite(S, weighted);
    return sharing;
}

void share_multipliers(const std::vector<Block>& blocks, const RowEntries& B,
                       const DescribedRows& all, RowSystem& s, const VecX& lam, VecX& shared) {
    shared = lam;
    if (!s.redundant) return;
    const LoadSharing& sharing = load_sharing(blocks, B, all, s);
    const std::vector<int>& rows = s.envelope.row_at;
    VecX multipliers(rows.size());
    for (size_t l = 0; l < rows.size(); ++l) multipliers[l] = lam[rows[l]];
    const VecX y = sharing.taken * multipliers;
    multipliers.noalias() -= sharing.W.transpose() * y;
    for (size_t l = 0; l < rows.size(); ++l) shared[rows[l]] = multipliers[l];
    for (size_t k = 0; k < sharing.dependent.size(); ++k) shared[sharing.dependent[k]] = y[k];
}

FreeMultipliers free_multipliers(const std::vector<Block>& blocks, const RowEntries& B, const DescribedRows& all,
                                 RowSystem& s) {
    LoadSharing& sharing = load_sharing(blocks, B, all, s);
    const FreeMultipliers free(s.envelope, sharing.free);
    if (sharing.has_free) return free;
    sharing.has_free = true;
    const VecX inverse = inverse_weights(all, s.envelope.row_at, sharing).first;
    MatX used = -sharing.W.transpose();
    for (size_t k = 0; k < sharing.dependent.size(); ++k)
        used(s.envelope.position[sharing.dependent[k]], static_cast<Eigen::Index>(k)) = 1.0;
    const MatX S = used.transpose() * inverse.asDiagonal() * used;
    Cholesky factor;
    factor.compute(S);
    sharing.free = factor.solve_lower(used.transpose()).transpose();
    return free;
}

VecX FreeMultipliers::of_row(int row) const {
    if (!is_used(row)) return VecX::Zero(count());
    return basis_.row(envelope_.position[row]).transpose();
}

double FreeMultipliers::norm_of_row(int row) const {
    return is_used(row) ? basis_.row(envelope_.position[row]).norm() : 0.0;
}

void FreeMultipliers::add(const VecX& z, VecX& lam) const {
    const VecX sum = basis_ * z;
    for (int l = 0; l < envelope_.size(); ++l) lam[envelope_.row_at[l]] += sum[l];
}

std::vector<int> FreeMultipliers::rows() const {
    std::vector<int> list = envelope_.row_at;
    std::sort(list.begin(), list.end());
    return list;
}

}  // namespace pn
