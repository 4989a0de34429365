// Configurations that are not vectors: unit quaternions (x, y, z, w) and (cos, sin) pairs, kept as plain numbers
// between steps and brought back to unit length at each step's end.
#pragma once

#include "tree/mechanism.hpp"

namespace pn {

// dq/dt in ambient coordinates (quaternions and cos/sin as plain numbers).
void configuration_rate(const Mechanism& m, const double* q, const double* v, double* dq);
// Unit length of quaternions and (cos, sin) restored.
void normalize(const Mechanism& m, double* q);
// Whether they have unit length, to this tolerance.
bool has_unit_lengths(const Mechanism& m, const double* q, double tolerance);
// Tangent coordinates of a small ambient change dq at q.
void ambient_to_tangent(const Mechanism& m, const double* q, const double* dq, double* tangent);
// q moved by the tangent vector w for unit time (exponential map).
void retract(const Mechanism& m, const double* q, const double* w, double* out);

}  // namespace pn
