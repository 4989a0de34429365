// Cone problem of contacts at rest. With normal and friction forces f as unknowns, the accelerations of gaps and slips
// are w = w0 + W f. The laws of Signorini and Coulomb give a cone problem (complementarity/cone/problem.hpp). The solution
// of this problem shows the lifting contacts and the slip directions, even for shared loads.
#pragma once

#include <vector>

#include "complementarity/cone/solver.hpp"
#include "contact/contact_rows.hpp"
#include "friction/slip_onset.hpp"

namespace pn {

struct OnsetMotion {
    std::vector<char> closed;     // per gap
    std::vector<Mode> modes;      // per element
    std::vector<Vec3> direction;  // slip direction at onset, per element
    std::vector<Vec3> friction;   // friction of each element, along its directions
    bool several = false;         // another motion is admissible as well
    int several_element = -1;     // element whose friction differs there, or -1 if this is not known
    bool shared = false;          // contacts are hyperstatic
    bool is_initial_guess = false;  // true if this is only an initial guess for the search of the motion

    bool slides() const;  // some contact slips or begins to slip
    // Set modes and slip directions of elements at rest, or the nearby motion of the query for an initial guess.
    void to_modes(const Program& p, Workspace& w, ModeQuery& query) const;
};

struct OnsetQuery {
    std::vector<char> rest;     // contacts at rest on each other
    int opening_gap = -1;  // contact of `rest` whose load just reached zero
    int arrived_element = -1;  // element that just came to rest or reached its limit
    std::vector<int> at_limit;  // elements that stuck and just reached their limit: they slip
    bool prescribed = false;    // the caller sets the modes
    bool after_impact = false;  // after an impact the velocity decides if a sticking element slips
};
// Check if the query treats an element as resting. `before`: run state before the query.
bool is_at_rest(const Program& p, const Workspace& w, const VecX& v, const OnsetQuery& query,
                const RunState& before, int element);

struct RestingProblemParameters {
    double rounding = 1e-12;              // rounding error relative to the scale of accelerations
    double common_slip_rounding = 1e-14;  // rounding error of a slip without own terms, relative to all accelerations
    double min_other_motion = 1e-6;       // motion that differs from rest, relative to the scale of accelerations
    double limit_rounding = 1e-9;         // rounding error relative to the limit of a force
    double at_limit_reduction = 1e-6;     // relative reduction of the limit of elements that just reached it
    int max_releases = 4;                 // rounds that set kinetic limits of slipping contacts
    int max_load_iterations = 100;        // maximum iterations of loads and their friction
    double load_tolerance = 1e-13;        // rounding error of the loads' change, relative to the largest acceleration
};

class RestingProblem {
public:
    using Parameters = RestingProblemParameters;
    static constexpr Parameters parameters{};

    // Another motion was found too: motion where rest is possible, or a further solution of the problem.
    bool several = false;

    // Set up the problem of the closed contacts `gaps` and of other friction elements at rest. The workspace must hold
    // the motion without their forces.
    RestingProblem(const Program& program, Workspace& workspace, const VecX& velocity, const std::vector<int>& gaps,
                   const std::vector<int>& others, const OnsetQuery& onset_query, const RunState& state);

    // Solve for the forces. Return false if no motion was found. `shared`: contacts are hyperstatic.
    bool solve(bool& shared);
    // Solve for forces that hold all contacts at rest. Rest is preferred to motion if both are possible.
    bool hold(ConeComplementarity& solver);
    // Check if a bound proves that the laws admit one motion. Sliding contacts and static ratios prove nothing.
    bool has_one_motion() const;
    // Store the motion under the forces.
    void read(OnsetMotion& out) const;

private:
    MatX chosen(const MatX& of_all) const;
    double limit(int element) const;
    // Numbers of normal rows and of friction rows of a cone.
    int head(size_t i) const { return cones[i].is(ConeElement::Kind::contact); }
    int tail(size_t i) const { return cones[i].dim - head(i); }
    auto tail_of(const VecX& x, size_t i) const { return x.segment(first[i] + head(i), tail(i)); }
    VecX accelerations();
    // Scale of the accelerations of all rows, or of some rows. The scale of all rows would hide the slip of a body
    // beside much lighter bodies.
    double acceleration_scale() const;
    double acceleration_scale(int row, int count) const;
    // Accelerations of these rows, and of the slip of a cone, that are rounding error.
    double rounding(int row, int count) const;
    double slip_rounding(size_t i) const { return rounding(first[i] + head(i), tail(i)); }
    bool at_its_limit(size_t i) const;
    bool moves() const;
    bool release();
    bool solve_cones(bool warm, bool& shared);
    bool alternate(const VecX& free);

    const Program& p;
    Workspace& w;
    const VecX& v;
    const OnsetQuery& query;
    const RunState& before;
    ContactRows rows;
    std::vector<char> slides;            // contacts with a known slip direction
    std::vector<ConeElement> cones;      // cones of the contacts (slipping contacts: normal row only)
    std::vector<int> first;              // first row of each in the problem
    MatX drag;                           // friction of slipping contacts along all rows, per unknown
    MatX W, dragging;  // accelerations of the problem's rows for a unit of each unknown, and for its friction
    VecX w0, f;
};

}  // namespace pn
