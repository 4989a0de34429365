// The evaluation at a step's start, which decides what holds over the step: the rows that are independent here.
#pragma once

#include "dynamics/workspace.hpp"

namespace pn {

// Evaluates and decides which rows are independent; contradicting rows are a failure.
void begin_step(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);
// The part of it that needs no forces: configures, and decides which rows are independent.
// Returns whether it chose among them.
bool begin_rows(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);
// Only that, where the workspace is configured.
bool configure_step(const Program& p, Workspace& w);
// An evaluation that decides them too, where the workspace is configured, after v was brought to A v + phi_t = 0; returns
// whether v moved.
bool begin_step_on_rates(const Program& p, Workspace& w, double t, VecX& v);
// The same with rows that were chosen there, or not; without the evaluation where nobody asks for it.
bool begin_step_on_rates(const Program& p, Workspace& w, double t, VecX& v, bool chosen, bool evaluates);
// Where modes have changed and rows just chosen would stop what moves: those that elements which stick hold by hardly any
// of their forces count as dependent from here on. The workspace must be evaluated at (q, v), and is so after.
void keep_moving(const Program& p, Workspace& w, double t, const VecX& v);
// Brings a state onto the rows of modes that have just been set, of which it chooses the independent ones there.
void project_into_modes(const Program& p, Workspace& w, double t, VecX& q, VecX& v);

}  // namespace pn
