// The user's Python functions as the core calls them: with the lock held, arrays copied both ways.
#pragma once

#include <functional>
#include <utility>

#include "dynamics/workspace.hpp"
#include "python/arrays.hpp"

namespace pn {

// What a user's law may ask about the reactions while it runs.
struct ReactionView {
    const Program* p;
    Workspace* w;
    Numbers lam() const;
    Numbers of_joint(int joint) const;
    Numbers of_block(int block) const;
};

// ("polynomial", [c...]), ("sinusoid", [a, f, phase, offset]), ("spline", [breaks], [coefficients]) or a function.
TimeFunction time_function(const nb::object& f);

// f(t, q, v) -> torques, generalized forces or rates; f(t, q) -> residuals or a direction; f(t, q, v) -> rows A and b.
using OfState = void(double t, const VecX& q, const VecX& v, VecX& out);
using OfPosition = void(double t, const VecX& q, VecX& out);
using Rows = void(double t, const VecX& q, const VecX& v, MatX& A, VecX& b);
// The same as Python sees them.
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
// f(t) -> force and moment.
std::function<void(double, double*)> wrench_function(nb::object f);

// Limit of friction, and force of a law; both may ask about the reactions.
decltype(Friction::user_limit) limit_function(nb::object f);
decltype(UserLaw::function) law_function(nb::object f, int states, bool reads_reactions);

void bind_reactions(nb::module_& m);

}  // namespace pn
