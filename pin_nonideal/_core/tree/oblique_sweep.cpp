#include "tree/oblique_sweep.hpp"

#include <algorithm>
#include <cmath>

namespace pn {

void ObliqueSweep::resize(const Mechanism& m) {
    axis.resize(m.nv);
    reaction.resize(m.joints.size());
    inertia_.resize(m.joints.size());
    force_.resize(m.joints.size());
    motion_.resize(m.joints.size());
    taken_.resize(m.nv);
    row_.resize(m.nv);
    inverse_.resize(m.nv);
    left_.resize(m.nv);
}

// M [r], the columns of M combined as by the cross product with r.
static PN_INLINE Mat3 times_cross(const Mat3& m, const Vec3& r) {
    const Vec3 &a = m.c[0], &b = m.c[1], &c = m.c[2];
    return {r[2] * b - r[1] * c, r[0] * c - r[2] * a, r[1] * a - r[0] * b};
}

static PN_INLINE Mat3 minus(const Mat3& a, const Mat3& b) { return {a.c[0] - b.c[0], a.c[1] - b.c[1], a.c[2] - b.c[2]}; }

static PN_INLINE void add_cross(const Vec3& r, const Mat3& m, Mat3& sum) {
    for (int k = 0; k < 3; ++k) sum.c[k] += r.cross(m.c[k]);
}

PN_WIDE bool ObliqueSweep::factorize(const Mechanism& m, const BodyTerms& terms) {
    const int joints = static_cast<int>(m.joints.size());
    for (int i = 1; i < joints; ++i) {
        const ArticulatedInertia own = articulated(terms.body[i].inertia);
        inertia_[i] = {own.lin, own.couple, transposed(own.couple), own.ang};
    }
    for (int i = joints - 1; i > 0; --i) {
        const Joint& j = m.joints[i];
        Blocks& P = inertia_[i];
        for (int k = j.iv + j.nv - 1; k >= j.iv; --k) {
            if (terms.locked[k]) continue;
            const Motion &S = terms.J[k], &T = axis[k];
            const Force u{P.lin * S.lin + P.couple * S.ang, P.cross * S.lin + P.ang * S.ang};
            const Force row{transpose_times(P.lin, T.lin) + transpose_times(P.cross, T.ang),
                            transpose_times(P.couple, T.lin) + transpose_times(P.ang, T.ang)};
            const double D = dot(T, u) + m.armature[k];
            const double inverse = 1.0 / D;
            if (!std::isfinite(inverse) || inverse == 0.0) return false;
            const Force part = inverse * row;
            for (int c = 0; c < 3; ++c) {
                P.lin.c[c] -= part.lin[c] * u.lin;
                P.cross.c[c] -= part.lin[c] * u.ang;
                P.couple.c[c] -= part.ang[c] * u.lin;
                P.ang.c[c] -= part.ang[c] * u.ang;
            }
            taken_[k] = u;
            row_[k] = row;
            inverse_[k] = inverse;
        }
        if (j.parent == 0) continue;
        Blocks& parent = inertia_[j.parent];
        parent.lin += P.lin;
        if (!j.deep) {
            parent.couple += P.couple;
            parent.cross += P.cross;
            parent.ang += P.ang;
            continue;
        }
        const Vec3& r = terms.deep.shift[i];
        const Mat3 couple = minus(P.couple, times_cross(P.lin, r));
        parent.couple += couple;
        parent.cross += P.cross;
        add_cross(r, P.lin, parent.cross);
        parent.ang += minus(P.ang, times_cross(P.cross, r));
        add_cross(r, couple, parent.ang);
    }
    return true;
}

double ObliqueSweep::relative_determinant(const BodyTerms& terms) const {
    double product = 1.0;
    for (Eigen::Index k = 0; k < inverse_.size(); ++k)
        if (!terms.locked[k]) product /= inverse_[k] * terms.D[k];
    return product;
}

double ObliqueSweep::least_relative_pivot(const BodyTerms& terms) const {
    double most = 0.0;
    for (Eigen::Index k = 0; k < inverse_.size(); ++k)
        if (!terms.locked[k]) most = std::max(most, std::abs(inverse_[k] * terms.D[k]));
    return most > 0.0 ? 1.0 / most : 1.0;
}

PN_WIDE void ObliqueSweep::solve(const Mechanism& m, const BodyTerms& terms, const Force* body, VecX& x) {
    const int joints = static_cast<int>(m.joints.size());
    for (int i = 1; i < joints; ++i) force_[i] = body && m.joints[i].deep ? body[i] : Force{};
    for (int i = joints - 1; i > 0; --i) {
        const Joint& j = m.joints[i];
        Force& f = force_[i];
        for (int k = j.iv + j.nv - 1; k >= j.iv; --k) {
            if (terms.locked[k]) continue;
            left_[k] = (x[k] + dot(axis[k], f)) * inverse_[k];
            f -= left_[k] * taken_[k];
        }
        if (j.parent != 0) force_[j.parent] += j.deep ? before(f, terms.deep.shift[i]) : f;
    }
    motion_[0] = Motion{};
    for (int i = 1; i < joints; ++i) {
        const Joint& j = m.joints[i];
        Motion& a = motion_[i];
        a = j.deep && j.parent != 0 ? further(motion_[j.parent], terms.deep.shift[i]) : motion_[j.parent];
        const Blocks& P = inertia_[i];
        reaction[i] = Force{P.lin * a.lin + P.couple * a.ang, P.cross * a.lin + P.ang * a.ang};
        reaction[i] -= force_[i];
        for (int k = j.iv; k < j.iv + j.nv; ++k) {
            if (terms.locked[k]) {
                x[k] = 0.0;
                continue;
            }
            x[k] = left_[k] - dot(a, row_[k]) * inverse_[k];
            a += x[k] * terms.J[k];
        }
    }
}

}  // namespace pn
