#include "constraints/block.hpp"

#include <algorithm>

#include "math/unrolled.hpp"
#include "tree/articulated.hpp"

namespace pn {

Block::Block(std::string its_name, Kind what)
    : name(std::move(its_name)),
      kind(std::move(what)),
      total(size(kind)),
      comparable_rows(has_comparable_rows(kind)),
      affine_rate(has_affine_rate(kind)) {
    const auto [frame1, frame2] = frames(kind);
    if (frame1) {
        joint1 = frame1->joint;
        joint2 = frame2->joint;
    }
    if (const auto* dof_slip = std::get_if<DofSlipRows>(&kind)) dof = dof_slip->dof;
    for (int k = 0; k < total; ++k) kept.push_back(k);
}

// Return the dofs of a kind. `joint1`, `joint2`: bodies of a geometric kind.
static DofSupport make_support(const Mechanism& m, const Kind& kind, int joint1, int joint2) {
    DofSupport out;
    std::vector<char> in(m.nv, 0);
    for (int dof : dofs(kind, m))
        for (int d = dof; d >= 0 && !in[d]; d = m.dof_parent[d]) in[d] = 1;
    std::vector<int> place(m.nv, -1);
    for (int d = m.nv - 1; d >= 0; --d)
        if (in[d]) {
            place[d] = static_cast<int>(out.dofs.size());
            out.dofs.push_back(d);
            out.deep |= m.is_deep[d] != 0;
        }
    for (int d : out.dofs) out.parent.push_back(m.dof_parent[d] < 0 ? -1 : place[m.dof_parent[d]]);
    if (!frames(kind).first) return out;
    // A differs from zero only on dofs that move one body and not the other.
    const std::vector<int> d1 = m.dofs_of(joint1), d2 = m.dofs_of(joint2);
    for (int d : d1)
        if (std::find(d2.begin(), d2.end(), d) == d2.end()) out.entries.push_back({place[d], d, 1.0});
    for (int d : d2)
        if (std::find(d1.begin(), d1.end(), d) == d1.end()) out.entries.push_back({place[d], d, -1.0});
    return out;
}

void Block::lay_out(const Mechanism& m, SharedSupports& shared) {
    holonomic.clear();
    for (int k : kept) holonomic.push_back(is_holonomic(kind, k));
    std::shared_ptr<const DofSupport> own;
    std::shared_ptr<const DofSupport>& known = frames(kind).first ? shared[{joint1, joint2}] : own;
    if (!known) known = std::make_shared<const DofSupport>(make_support(m, kind, joint1, joint2));
    acts_on = known;
}

void BlockValues::resize(const std::vector<Block>& blocks, int nv) {
    storage_.clear();
    for (const Block& block : blocks) storage_.emplace_back(block.kind);
    known_.clear();
    known_.resize(blocks.size());
    nv_ = nv;
}

[[gnu::noinline]] RowValues& BlockValues::allocate(size_t block) const {
    known_[block] = std::make_unique<RowValues>();
    known_[block]->resize(storage_[block], nv_);
    return *known_[block];
}

// Return a unit wrench as a force on one body of a block, about its reference point. The reference points of both
// bodies differ if the bodies belong to different trees or to a deep tree.
static PN_INLINE Force about(const Wrench& w, const Body& body) {
    return {w.force, w.couple + (w.point - body.ref).cross(w.force)};
}

// Fill A of bodies in deep trees, which have their own reference points.
[[gnu::noinline]] static void fill_deep_A(const Block& block, const Mechanism& m, const Terms& terms,
                                          const RowValues& values, double* A) {
    const int r = static_cast<int>(block.kept.size());
    for (int k = 0; k < r; ++k) {
        const Wrench& w = values.wrench[block.kept[k]];
        for (const DofSupport::Entry& e : block.entries())  // Eq. (3)
            A[e.place * r + k] = e.sign * dot(terms.J[e.dof], about(w, terms.body[m.dof_joint[e.dof]]));
    }
}

PN_WIDE void fill_A(const Block& block, const Mechanism& m, const Terms& terms, const RowValues& values, double* A) {
    const int r = static_cast<int>(block.kept.size()), n = static_cast<int>(block.support().size());
    if (!values.geometric) {
        for (int l = 0; l < n; ++l)
            for (int k = 0; k < r; ++k) A[l * r + k] = values.A(block.kept[k], block.support()[l]);  // Eq. (3)
        return;
    }
    std::fill(A, A + static_cast<size_t>(r) * n, 0.0);
    if (block.is_deep()) return fill_deep_A(block, m, terms, values, A);
    for (int k = 0; k < r; ++k) {
        const Wrench& w = values.wrench[block.kept[k]];
        const Force f1 = about(w, terms.body[block.joint1]), f2 = about(w, terms.body[block.joint2]);
        for (const DofSupport::Entry& e : block.entries()) {
            A[e.place * r + k] = e.sign > 0.0 ? dot(terms.J[e.dof], f1) : -dot(terms.J[e.dof], f2);  // Eq. (3)
        }
    }
}

// Scale the part of the rows on deep trees. The wrench of a row between bodies enters the sweep, and other rows enter
// by their entries. A separate function leaves the registers of scale_rows to the common part.
[[gnu::noinline]] static void scale_deep_rows(const Mechanism& m, Terms& terms, const Block& block,
                                              const RowValues& values, double* B) {
    const int r = static_cast<int>(block.kept.size());
    for (int k = 0; k < r; ++k) {
        Force f1, f2;
        if (values.geometric) {
            const Wrench& w = values.wrench[block.kept[k]];
            f1 = about(w, terms.body[block.joint1]);
            f2 = about(w, terms.body[block.joint2]);
            for (size_t l = 0; l < block.support().size(); ++l)
                if (m.is_deep[block.support()[l]]) B[l * r + k] = 0.0;
        }
        scale_row_articulated(m, terms, block.support(), block.joint1, f1, block.joint2, f2, B + k, r);
    }
}

// Scale the part of the rows on dofs with rows of the factor.
template <bool some_deep>
static PN_INLINE void scale_flat_rows(const Mechanism& m, const Terms& terms, const Block& block, double* B) {
    const int n = static_cast<int>(block.support().size());
    const double *L = terms.L.data(), *inv_sqrt_D = terms.inv_sqrt_D.data();
    with_rows(static_cast<int>(block.kept.size()), [&](auto r) {
        for (int l = 0; l < n; ++l) {
            const int dof = block.support()[l];
            if (some_deep && m.is_deep[dof]) continue;
            const double* row = L + m.row_offset[dof];
            double* __restrict x = B + l * r;
            for (int p = block.parent()[l], s = 1; p >= 0; p = block.parent()[p], ++s) {
                double* __restrict y = B + p * r;  // entries of an ancestor
                for (int k = 0; k < r; ++k) y[k] -= row[s] * x[k];
            }
            const double d = inv_sqrt_D[dof];
            for (int k = 0; k < r; ++k) x[k] *= d;  // Eq. (7)
        }
    });
}

void scale_rows(const Mechanism& m, Terms& terms, const Block& block, const RowValues& values, const double* A,
                double* B) {
    std::copy(A, A + block.kept.size() * block.support().size(), B);
    if (!block.is_deep()) return scale_flat_rows<false>(m, terms, block, B);
    scale_deep_rows(m, terms, block, values, B);
    scale_flat_rows<true>(m, terms, block, B);
}

void add_transpose(const Block& block, const RowEntries& B, const VecX& lam, VecX& y) {
    with_rows(static_cast<int>(block.kept.size()), [&](auto r) {
        const double *x = B.data() + block.offset, *l = lam.data() + block.row;
        for (size_t p = 0; p < block.support().size(); ++p, x += r) {
            double sum = 0.0;
            for (int k = 0; k < r; ++k) sum += x[k] * l[k];
            y[block.support()[p]] += sum;
        }
    });
}

void add_transpose(const Block& block, const Mechanism& m, const Terms& terms, const RowValues& values,
                   const RowEntries& A, const VecX& lam, VecX& y, std::vector<Force>& body) {
    const size_t r = block.kept.size();
    for (size_t l = 0; l < block.support().size(); ++l) {
        const int dof = block.support()[l];
        if (values.geometric && m.is_deep[dof]) continue;
        for (size_t k = 0; k < r; ++k) y[dof] += A[block.offset + l * r + k] * lam[block.row + k];
    }
    if (!values.geometric) return;
    for (size_t k = 0; k < r; ++k) add_wrench(block, terms, values.wrench[block.kept[k]], lam[block.row + k], body);
}

void multiply(const Block& block, const RowEntries& B, const VecX& x, VecX& r) {
    with_rows(static_cast<int>(block.kept.size()), [&](auto n) {
        const double* a = B.data() + block.offset;
        double* __restrict out = r.data() + block.row;
        for (int k = 0; k < n; ++k) out[k] = 0.0;
        for (size_t p = 0; p < block.support().size(); ++p, a += n) {
            const double xp = x[block.support()[p]];
            for (int k = 0; k < n; ++k) out[k] += a[k] * xp;
        }
    });
}

void add_along(const Block& block, const RowEntries& rows, const Vec3& f, VecX& force) {
    const int n = static_cast<int>(block.kept.size());
    const double* A = rows.data() + block.offset;
    for (size_t l = 0; l < block.support().size(); ++l) {
        double sum = 0.0;
        for (int k = 0; k < n; ++k) sum += A[l * n + k] * f[k];
        if (sum != 0.0) force[block.support()[l]] += sum;
    }
}

}  // namespace pn
