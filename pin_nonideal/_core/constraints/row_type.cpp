#include "constraints/row_type.hpp"

#include <algorithm>

#include "constraints/row_completeness.hpp"

namespace pn {

namespace {

template <class... K>
constexpr bool all_complete(const std::variant<K...>*) { return (is_complete<K>() && ...); }
static_assert(all_complete(static_cast<const Kind*>(nullptr)));

}  // namespace

int size(const Kind& kind) {
    return std::visit([](const auto& k) { return k.size(); }, kind);
}

bool is_holonomic(const Kind& kind, int row) {
    return std::visit([row](const auto& k) { return k.is_holonomic(row); }, kind);
}

bool moves_in_time(const Kind& kind) {
    return std::visit([](const auto& k) { return k.moves_in_time(); }, kind);
}

bool has_constant_A(const Kind& kind) {
    return std::visit([](const auto& k) { return k.constant_A; }, kind);
}

bool has_affine_rate(const Kind& kind) {
    return std::visit([](const auto& k) { return k.affine_rate; }, kind);
}

bool has_comparable_rows(const Kind& kind) {
    return std::visit([](const auto& k) { return k.comparable_rows; }, kind);
}

int pressing_row(const Kind& kind) {
    return std::visit([](const auto& k) {
        if constexpr (answers<std::decay_t<decltype(k)>>([](const auto& row) -> decltype(row.pressing) { return {}; }))
            return k.pressing;
        else
            return -1;
    }, kind);
}

Role role(const Kind& kind) {
    return std::visit([](const auto& k) { return k.role; }, kind);
}

DisplayKind shown(const Kind& kind) {
    return std::visit([](const auto& k) { return k.shown; }, kind);
}

std::vector<const TimeFunction*> time_functions(const Kind& kind) {
    std::vector<const TimeFunction*> functions;
    std::visit([&](const auto& k) {
        std::apply([&](const auto&... datum) {
            const auto take = [&](const auto& value) {
                if constexpr (std::is_same_v<std::decay_t<decltype(value)>, TimeFunction>) functions.push_back(&value);
            };
            (take(k.*datum.member), ...);
        }, std::decay_t<decltype(k)>::data());
    }, kind);
    return functions;
}

std::pair<const Frame*, const Frame*> frames(const Kind& kind) {
    return std::visit([](const auto& k) -> std::pair<const Frame*, const Frame*> {
        if constexpr (is_geometric<std::decay_t<decltype(k)>>) return {k.frame1.get(), k.frame2.get()};
        else return {nullptr, nullptr};
    }, kind);
}

std::vector<int> dofs(const Kind& kind, const Mechanism& m) {
    return std::visit([&m](const auto& k) {
        if constexpr (is_geometric<std::decay_t<decltype(k)>>) {
            std::vector<int> both = m.dofs_of(k.frame1->joint);
            for (int d : m.dofs_of(k.frame2->joint)) both.push_back(d);
            return both;
        } else {
            return k.dofs(m);
        }
    }, kind);
}

RowStorage::RowStorage(const Kind& kind)
    : rows(size(kind)), geometric(frames(kind).first != nullptr), constant_A(has_constant_A(kind)) {}

void RowValues::resize(const RowStorage& storage, int nv) {
    rows = storage.rows;
    geometric = storage.geometric;
    constant_A = storage.constant_A;
    wrench.assign(geometric ? rows : 0, Wrench{Vec3::Zero(), Vec3::Zero(), Vec3::Zero()});
    for (std::vector<double>* x : {&bias, &residual, &rate, &phi_t, &phi_tt}) x->assign(rows, 0.0);
    if (geometric) return;
    A = MatX::Zero(rows, nv);
    b = VecX::Zero(rows);
    scratch = VecX::Zero(std::max(rows, 2 * nv));  // rows, or two directions in sequence
}

template <Part part, class K, class At>
static PN_INLINE void evaluate_at(const K& kind, const At& at, RowValues& out) {
    if constexpr (part == Part::motion) {
        kind.rate_and_bias(at, out);
    } else if constexpr (part == Part::place && places<K, At>) {
        kind.place(at, out);
    } else {
        kind.residual(at, out);
        if constexpr (part == Part::place) {
            if (!out.has_A) kind.rows(at, out);
        }
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

// Like std::visit but inlined into the caller, for the first kinds of constraint.
template <Part part, size_t... k>
static PN_INLINE void evaluate_some(const Kind& kind, const State& s, RowValues& out, std::index_sequence<k...>) {
    (void)((kind.index() == k && (evaluate_kind<part>(*std::get_if<k>(&kind), s, out), true)) || ...);
}

template <Part part, size_t count>
static PN_INLINE void evaluate_until(const Kind& kind, const State& s, RowValues& out) {
    evaluate_some<part>(kind, s, out, std::make_index_sequence<count>());
}

template <class Sought, class... K>
static constexpr size_t index_of(const std::variant<K...>*) {
    size_t i = 0;
    (void)((std::is_same_v<Sought, K> || (++i, false)) || ...);
    return i;
}

// Three wide functions evaluate the first kinds. The last kinds are gaps between shapes, which search for nearest points.
// Each other kind has separate functions, compiled once: wide functions for all kinds take 20 s more to compile (GCC 12) and
// run no faster.
constexpr size_t shapes = index_of<PlaneRimOrEllipsoidRow>(static_cast<const Kind*>(nullptr));
static PN_WIDE void residual(const Kind& kind, const State& s, RowValues& out) {
    evaluate_until<Part::residual, shapes>(kind, s, out);
}
static PN_WIDE void place(const Kind& kind, const State& s, RowValues& out) {
    evaluate_until<Part::place, shapes>(kind, s, out);
}
static PN_WIDE void motion(const Kind& kind, const State& s, RowValues& out) {
    evaluate_until<Part::motion, shapes>(kind, s, out);
}

template <Part part>
static void evaluate_shapes(const Kind& kind, const State& s, RowValues& out) {
    std::visit([&](const auto& k) {
        if constexpr (index_of<std::decay_t<decltype(k)>>(static_cast<const Kind*>(nullptr)) >= shapes)
            evaluate_kind<part>(k, s, out);
    }, kind);
}

void evaluate(const Kind& kind, const State& s, Part part, RowValues& out) {
    const bool of_shapes = kind.index() >= shapes;
    switch (part) {
        case Part::residual: return of_shapes ? evaluate_shapes<Part::residual>(kind, s, out) : residual(kind, s, out);
        case Part::place: return of_shapes ? evaluate_shapes<Part::place>(kind, s, out) : place(kind, s, out);
        case Part::motion: return of_shapes ? evaluate_shapes<Part::motion>(kind, s, out) : motion(kind, s, out);
    }
}

}  // namespace pn
