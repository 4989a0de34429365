#include "constraints/kind.hpp"

#include <algorithm>

namespace pn {

void RowValues::resize(const Kind& kind, int nv) {
    rows = size(kind);
    geometric = frames(kind).first != nullptr;
    constant_A = has_constant_A(kind);
    wrench.assign(geometric ? rows : 0, Wrench{Vec3::Zero(), Vec3::Zero(), Vec3::Zero()});
    for (std::vector<double>* x : {&drift, &residual, &rate, &phi_t, &phi_tt}) x->assign(rows, 0.0);
    if (geometric) return;
    A = MatX::Zero(rows, nv);
    b = VecX::Zero(rows);
    scratch = VecX::Zero(std::max(rows, 2 * nv));  // rows, or two directions one after the other
}

template <Part part, class K, class At>
static PN_INLINE void evaluate_at(const K& kind, const At& at, RowValues& out) {
    if constexpr (part == Part::motion) {
        kind.rate_and_drift(at, out);
    } else {
        kind.residual(at, out);
        if (part == Part::place && !out.has_A) kind.rows(at, out);
    }
}

template <Part part, class K>
static PN_INLINE void evaluate_kind(const K& kind, const State& s, RowValues& out) {
    if constexpr (is_geometric<K>) {
        const Sides<Pose> sides{Pose(s.mechanism, s.terms, kind.frame1), Pose(s.mechanism, s.terms, kind.frame2), s.t};
        evaluate_at<part>(kind, sides, out);
    } else {
        evaluate_at<part>(kind, s, out);
    }
}

// Like std::visit, but part of the caller.
template <Part part, size_t... k>
static PN_INLINE void evaluate_part(const Kind& kind, const State& s, RowValues& out, std::index_sequence<k...>) {
    (void)((kind.index() == k && (evaluate_kind<part>(*std::get_if<k>(&kind), s, out), true)) || ...);
}

PN_WIDE void evaluate(const Kind& kind, const State& s, Part part, RowValues& out) {
    constexpr auto kinds = std::make_index_sequence<std::variant_size_v<Kind>>();
    switch (part) {
        case Part::residual: evaluate_part<Part::residual>(kind, s, out, kinds); break;
        case Part::place: evaluate_part<Part::place>(kind, s, out, kinds); break;
        case Part::motion: evaluate_part<Part::motion>(kind, s, out, kinds); break;
    }
}

}  // namespace pn
