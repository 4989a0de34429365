// User functions in Python, as called by the core: with the GIL held, and arrays copied both ways.
#pragma once

#include <functional>
#include <utility>

#include "dynamics/workspace.hpp"
#include "python/arrays.hpp"

namespace pn {

// Reactions that a user law can read while it runs.
struct ReactionView {
    const Program* p;
    Workspace* w;
    Numbers lam() const;
    Numbers of_joint(int joint) const;
    Numbers of_block(int block) const;
};

// Return the time function of ("polynomial", [c...]), ("sinusoid", [a, f, phase, offset]), ("spline", [breaks],
// [coefficients]) or a Python function.
TimeFunction time_function(const nb::object& f);

// User functions in the core:
// - f(t, q, v) -> torques, generalized forces or rates,
// - f(t, q) -> residuals or a direction,
// - f(t, q, v) -> rows A and b.
using OfState = void(double t, const VecX& q, const VecX& v, VecX& out);
using OfPosition = void(double t, const VecX& q, VecX& out);
using Rows = void(double t, const VecX& q, const VecX& v, MatX& A, VecX& b);
// Signatures of the same functions in Python.
template <class Signature> struct Seen;
template <> struct Seen<OfState> { using Type = Numbers(double, Numbers, Numbers); };
template <> struct Seen<OfPosition> { using Type = Numbers(double, Numbers); };
template <> struct Seen<Rows> { using Type = std::pair<Table, Numbers>(double, Numbers, Numbers); };
template <class Signature>
std::function<Signature> user_function(nb::callable f);
template <>
std::function<OfState> user_function(nb::callable f);
template <>
std::function<OfPosition> user_function(nb::callable f);
template <>
std::function<Rows> user_function(nb::callable f);
// Wrap a user function f(t) -> force and moment.
std::function<void(double, double*)> wrench_function(nb::object f);

// Wrap a user's friction limit, or the force of a user's law. Both can read the reactions.
decltype(Friction::user_limit) limit_function(nb::object f);
decltype(UserLaw::function) law_function(nb::object f, int states, bool reads_reactions);

void bind_reactions(nb::module_& m);

}  // namespace pn
