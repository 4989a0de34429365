// Members that a struct needs to be a kind of constraint, checked at compile time.
#pragma once

#include <string>
#include <type_traits>

#include "constraints/geometry.hpp"
#include "constraints/row_traits.hpp"

namespace pn {

struct RowValues;
struct State;

template <class K> constexpr bool is_plane_gap = std::is_base_of_v<PlaneGap, K>;
template <class K> constexpr bool is_shape_gap = std::is_base_of_v<ShapeGap, K>;
template <class K, class = void>
constexpr bool is_geometric = false;
template <class K>
constexpr bool is_geometric<K, std::void_t<decltype(&K::frame1), decltype(&K::frame2)>> = true;

// Check if the lambda `Question` compiles for a K.
template <class K, class Question>
constexpr bool answers(Question) { return std::is_invocable_v<Question, const K&>; }
// Constants of K as types, for use in such lambdas.
template <class K> using ConstantA = std::bool_constant<std::decay_t<K>::constant_A>;
template <class K> using AffineRate = std::bool_constant<std::decay_t<K>::affine_rate>;
template <class K> using ComparableRows = std::bool_constant<std::decay_t<K>::comparable_rows>;
template <class K> using ShownAs = std::integral_constant<DisplayKind, std::decay_t<K>::shown>;
template <class K> using Called = decltype(std::string(std::decay_t<K>::name));
template <class K> using RoleOf = std::integral_constant<Role, std::decay_t<K>::role>;
// A value of type T for unevaluated expressions. The function has no definition.
template <class T> T given();

// Check if K has `place`, which computes residual and rows at once from the same nearest points.
template <class K, class At, class Out = RowValues>
constexpr bool places = answers<K>([](const auto& k) -> decltype(k.place(given<At>(), given<Out&>())) {});

// Check at compile time that K has all members of a kind of constraint.
template <class K>
constexpr bool is_complete() {
    using At = std::conditional_t<is_geometric<K>, const Sides<Pose>&, const State&>;
    static_assert(answers<K>([](const auto& k) -> Called<decltype(k)> { return {}; }),
                  "a kind needs `static constexpr const char* name`: by which Python adds it");
    static_assert(answers<K>([](const auto& k) -> RoleOf<decltype(k)> { return {}; }),
                  "a kind needs `static constexpr Role role`: a constraint, a contact or a direction of friction");
    static_assert(answers<K>([](const auto& k) -> decltype(k.data(), void()) {}),
                  "a kind needs `static constexpr auto data()`: its fields, by name");
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
                  "a kind needs `static constexpr DisplayKind shown`: its display in a replay");
    static_assert(answers<K>([](const auto& k) -> decltype(k.residual(given<At>(), given<RowValues&>())) {}),
                  "a kind needs `residual`: phi(q, t) of each row, with phi_t and phi_tt where it moves");
    static_assert(places<K, At> || answers<K>([](const auto& k) -> decltype(k.rows(given<At>(), given<RowValues&>())) {}),
                  "a kind needs `rows`: unit wrenches, or A itself; or `place`: residual and rows at once");
    static_assert(answers<K>([](const auto& k) -> decltype(k.rate_and_bias(given<At>(), given<RowValues&>())) {}),
                  "a kind needs `rate_and_bias`: A v + phi_t, and its rate at zero acceleration");
    static_assert(!std::is_base_of_v<GapKind, K> || !is_geometric<K> || is_plane_gap<K> || is_shape_gap<K>,
                  "a gap between bodies needs a base `PlaneGap` or `ShapeGap`, for its bounds over a step");
    static_assert(!is_plane_gap<K> || answers<K>([](const auto& k) -> decltype(double(k.extent1())) { return 0.0; }),
                  "a gap needs `double extent1() const`: the distance of the farthest point of shape 1 from frame 1");
    if constexpr (is_shape_gap<K>) {
        static_assert(answers<K>([](const auto& k) -> decltype(k.extent1() + k.extent2()) { return 0.0; }),
                      "a gap needs `extent1`, `extent2`: the distance of the farthest point of each shape from its frame");
        static_assert(answers<K>([](const auto& k) -> decltype(k.support1(Vec3()) + k.support2(Vec3())) { return 0.0; }),
                      "a gap needs `support1`, `support2`: largest component of each shape along a direction in its frame");
        static_assert(answers<K>([](const auto& k) -> decltype(Vec3(k.normal(given<At>()))) { return {}; }),
                      "a gap needs `normal`: the direction from the nearest point of shape 2 to that of shape 1");
        static_assert(answers<K>([](const auto& k) -> decltype(double(k.max_depth())) { return 0.0; }),
                      "a gap needs `double max_depth() const`: the penetration up to which its direction is defined");
        static_assert(answers<K>([](const auto& k) -> decltype(double(k.depth_to_next_face(Vec3()))) { return 0.0; }),
                      "a gap needs `double depth_to_next_face(at) const`: the penetration before another face is nearest");
        static_assert(answers<K>([](const auto& k) -> decltype(double(k.radius)) { return 0.0; }),
                      "a gap needs `double radius`: the sum of both radii");
    }
    return true;
}

}  // namespace pn
