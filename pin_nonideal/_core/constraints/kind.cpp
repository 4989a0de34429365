#include "constraints/kind.hpp"

#include <algorithm>
#include <string>
#include <type_traits>

namespace pn {

namespace {

template <class K, class = void>
constexpr bool is_geometric = false;
template <class K>
constexpr bool is_geometric<K, std::void_t<decltype(&K::frame1), decltype(&K::frame2)>> = true;

// Whether K answers a question: a lambda that asks it.
template <class K, class Question>
constexpr bool answers(Question) { return std::is_invocable_v<Question, const K&>; }
// Its constants as types, so that a question can ask for them.
template <class K> using ConstantA = std::bool_constant<std::decay_t<K>::constant_A>;
template <class K> using AffineRate = std::bool_constant<std::decay_t<K>::affine_rate>;
template <class K> using ComparableRows = std::bool_constant<std::decay_t<K>::comparable_rows>;
template <class K> using ShownAs = std::integral_constant<Shown, std::decay_t<K>::shown>;
template <class K> using Called = decltype(std::string(std::decay_t<K>::name));
template <class K> using RoleOf = std::integral_constant<Role, std::decay_t<K>::role>;
// Something of a type, in questions that nobody asks.
template <class T> T given();

// Whether K gives residual and rows at once, from nearest points found once.
template <class K, class At>
constexpr bool places = answers<K>([](const auto& k) -> decltype(k.place(given<At>(), given<RowValues&>())) {});

// A struct is a kind when it says all this of itself.
template <class K>
constexpr bool is_complete() {
    using At = std::conditional_t<is_geometric<K>, const Sides<Pose>&, const State&>;
    static_assert(answers<K>([](const auto& k) -> Called<decltype(k)> { return {}; }),
                  "a kind needs `static constexpr const char* name`: by which Python adds it");
    static_assert(answers<K>([](const auto& k) -> RoleOf<decltype(k)> { return {}; }),
                  "a kind needs `static constexpr Role role`: a constraint, a contact or a direction of friction");
    static_assert(answers<K>([](const auto& k) -> decltype(k.data(), void()) {}),
                  "a kind needs `static constexpr auto data()`: what it is made of, by name");
    static_assert(answers<K>([](const auto& k) -> decltype(int(k.size())) { return 0; }),
                  "a kind needs `int size() const`: its number of rows");
    static_assert(answers<K>([](const auto& k) -> decltype(bool(k.is_holonomic(0))) { return true; }),
                  "a kind needs `bool is_holonomic(int row) const`: whether a position stands behind the row");
    static_assert(answers<K>([](const auto& k) -> decltype(bool(k.moves_in_time())) { return true; }),
                  "a kind needs `bool moves_in_time() const`: whether its rate may differ from zero at rest");
    static_assert(is_geometric<K> ||
                      answers<K>([](const auto& k) -> decltype(k.dofs(given<const Mechanism&>())) { return {}; }),
                  "a kind needs `Frame frame1, frame2`, or `std::vector<int> dofs(const Mechanism&) const`");
    static_assert(answers<K>([](const auto& k) -> ConstantA<decltype(k)> { return {}; }),
                  "a kind needs `static constexpr bool constant_A`: whether A never changes");
    static_assert(answers<K>([](const auto& k) -> AffineRate<decltype(k)> { return {}; }),
                  "a kind needs `static constexpr bool affine_rate`: whether its rate is A(q, t) v + phi_t");
    static_assert(answers<K>([](const auto& k) -> ComparableRows<decltype(k)> { return {}; }),
                  "a kind needs `static constexpr bool comparable_rows`: components of one vector");
    static_assert(answers<K>([](const auto& k) -> ShownAs<decltype(k)> { return {}; }),
                  "a kind needs `static constexpr Shown shown`: what a replay shows of it");
    static_assert(answers<K>([](const auto& k) -> decltype(k.residual(given<At>(), given<RowValues&>())) {}),
                  "a kind needs `residual`: phi(q, t) of each row, with phi_t and phi_tt where it moves");
    static_assert(places<K, At> || answers<K>([](const auto& k) -> decltype(k.rows(given<At>(), given<RowValues&>())) {}),
                  "a kind needs `rows`: unit wrenches, or A itself; or `place`: residual and rows at once");
    static_assert(answers<K>([](const auto& k) -> decltype(k.rate_and_drift(given<At>(), given<RowValues&>())) {}),
                  "a kind needs `rate_and_drift`: A v + phi_t, and its rate at zero acceleration");
    return true;
}

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
        if constexpr (answers<std::decay_t<decltype(k)>>([](const auto& own) -> decltype(own.pressing) { return {}; }))
            return k.pressing;
        else
            return -1;
    }, kind);
}

Shown shown(const Kind& kind) {
    return std::visit([](const auto& k) { return k.shown; }, kind);
}

std::pair<const Frame*, const Frame*> frames(const Kind& kind) {
    return std::visit([](const auto& k) -> std::pair<const Frame*, const Frame*> {
        if constexpr (is_geometric<std::decay_t<decltype(k)>>) return {&k.frame1, &k.frame2};
        else return {nullptr, nullptr};
    }, kind);
}

std::vector<int> dofs(const Kind& kind, const Mechanism& m) {
    return std::visit([&m](const auto& k) {
        if constexpr (is_geometric<std::decay_t<decltype(k)>>) {
            std::vector<int> both = m.dofs_of(k.frame1.joint);
            for (int d : m.dofs_of(k.frame2.joint)) both.push_back(d);
            return both;
        } else {
            return k.dofs(m);
        }
    }, kind);
}

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

// Like std::visit, but part of the caller; the kinds from the first on, one for each index k.
template <Part part, size_t first, size_t... k>
static PN_INLINE void evaluate_some(const Kind& kind, const State& s, RowValues& out, std::index_sequence<k...>) {
    (void)((kind.index() == first + k && (evaluate_kind<part>(*std::get_if<first + k>(&kind), s, out), true)) || ...);
}

template <Part part, size_t first, size_t last>
static PN_INLINE void evaluate_between(const Kind& kind, const State& s, RowValues& out) {
    evaluate_some<part, first>(kind, s, out, std::make_index_sequence<last - first>());
}

template <class Sought, class... K>
static constexpr size_t index_of(const std::variant<K...>*) {
    size_t i = 0;
    (void)((std::is_same_v<Sought, K> || (++i, false)) || ...);
    return i;
}

// Gaps between shapes, whose nearest points are searched for, stand last. Six functions and not one: compilers take far
// more than twice the time for a function of twice the size.
constexpr size_t shapes = index_of<EllipsoidRow>(static_cast<const Kind*>(nullptr)), all = std::variant_size_v<Kind>;
static PN_WIDE void residual(const Kind& kind, const State& s, RowValues& out) {
    evaluate_between<Part::residual, 0, shapes>(kind, s, out);
}
static PN_WIDE void place(const Kind& kind, const State& s, RowValues& out) {
    evaluate_between<Part::place, 0, shapes>(kind, s, out);
}
static PN_WIDE void motion(const Kind& kind, const State& s, RowValues& out) {
    evaluate_between<Part::motion, 0, shapes>(kind, s, out);
}
static PN_WIDE void residual_of_shapes(const Kind& kind, const State& s, RowValues& out) {
    evaluate_between<Part::residual, shapes, all>(kind, s, out);
}
static PN_WIDE void place_of_shapes(const Kind& kind, const State& s, RowValues& out) {
    evaluate_between<Part::place, shapes, all>(kind, s, out);
}
static PN_WIDE void motion_of_shapes(const Kind& kind, const State& s, RowValues& out) {
    evaluate_between<Part::motion, shapes, all>(kind, s, out);
}

void evaluate(const Kind& kind, const State& s, Part part, RowValues& out) {
    const bool of_shapes = kind.index() >= shapes;
    switch (part) {
        case Part::residual: return of_shapes ? residual_of_shapes(kind, s, out) : residual(kind, s, out);
        case Part::place: return of_shapes ? place_of_shapes(kind, s, out) : place(kind, s, out);
        case Part::motion: return of_shapes ? motion_of_shapes(kind, s, out) : motion(kind, s, out);
    }
}

}  // namespace pn
