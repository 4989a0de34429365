// The evaluation at a step's start, which decides what holds over the step: the rows that are independent here.
#pragma once

#include "dynamics/workspace.hpp"

namespace pn {

// Rows that must hold in these modes: constraints, and elements that stick elsewhere than in a joint (a joint that
// sticks is locked instead, which costs less than letting it move). All count as independent until a step begins.
void select_rows(const Program& p, Workspace& w);
// Evaluates and decides which rows are independent; contradicting rows are a failure.
void begin_step(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);
// The same where the workspace is configured, after v was brought to A v + phi_t = 0; returns whether v moved.
bool begin_step_on_rates(const Program& p, Workspace& w, double t, VecX& v);

}  // namespace pn
