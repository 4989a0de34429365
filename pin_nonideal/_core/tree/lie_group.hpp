// Configurations that are not vectors: unit quaternions (x, y, z, w) and (cos, sin) pairs. A step treats such configurations
// as plain numbers and restores unit length at its end.
#pragma once

#include "tree/mechanism.hpp"

namespace pn {

// Compute dq/dt in ambient coordinates (quaternions and cos/sin as plain numbers).
void configuration_rate(const Mechanism& m, const double* q, const double* v, double* dq);
// Restore the unit length of quaternions and (cos, sin) pairs.
void normalize(const Mechanism& m, double* q);
// Check if quaternions and (cos, sin) pairs have unit length within the tolerance.
bool has_unit_lengths(const Mechanism& m, const double* q, double tolerance);
// Compute tangent coordinates of a small ambient change dq at q.
void ambient_to_tangent(const Mechanism& m, const double* q, const double* dq, double* tangent);
// Move q by the tangent vector w for unit time (exponential map).
void retract(const Mechanism& m, const double* q, const double* w, double* out);

}  // namespace pn
