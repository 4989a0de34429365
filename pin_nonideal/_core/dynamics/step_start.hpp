// The evaluation at a step's start, which decides what holds over the step: the rows that are independent here.
#pragma once

#include "dynamics/workspace.hpp"

namespace pn {

// Evaluates and decides which rows are independent; contradicting rows are a failure.
void begin_step(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);
// The same where the workspace is configured, after v was brought to A v + phi_t = 0; returns whether v moved.
bool begin_step_on_rates(const Program& p, Workspace& w, double t, VecX& v);

}  // namespace pn
