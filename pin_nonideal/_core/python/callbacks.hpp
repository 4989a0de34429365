// The user's Python functions as the core calls them: with the lock held, arrays copied both ways.
#pragma once

#include <vector>

#include "python/bindings.hpp"

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

// f(t, q, v) -> torques or generalized forces.
std::function<void(double, const VecX&, const VecX&, VecX&)> torque_function(nb::object f);
// f(t) -> force and moment.
std::function<void(double, double*)> wrench_function(nb::object f);

// Rows A and right-hand side, residual and rate of a constraint; the last two may be None.
UserRows user_rows(int count, nb::object rows, nb::object residual, nb::object rate);
UserSlipRow slip_row(nb::object direction);

// Limit of friction, and force of a law; both may ask about the reactions.
decltype(Friction::user_limit) limit_function(nb::object f);
decltype(UserLaw::function) law_function(nb::object f, int states, bool reads_reactions);

}  // namespace pn
