// Nonideal laws: what C(q, v, t, reactions) is made of Eq. (9), w^T F^c = w^T C.
//
// Each smooth law is one struct that says what it exerts, through one function `act`, on dofs, on bodies or along the
// rows of a block, and how its own states change. The same function makes C and, where joints carry its forces, the
// reactions. Dry friction, whose elements stick and slip, is in friction.hpp.
#pragma once

#include <cmath>
#include <functional>
#include <type_traits>
#include <variant>
#include <vector>

#include "constraints/block.hpp"

namespace pn {

struct Program;
struct Workspace;
struct Evaluation;

// Which reactions a law reads: none, those of the ideal constraints alone, or those of the motion that it causes.
enum class Reaction { none, ideal, total };

// What laws may read at a state.
struct LawState {
    const Terms& terms;
    const std::vector<RowValues>& values;  // of each block, its rates
    const VecX& v;
    const VecX& z;
    const std::vector<VecX>& user_force;  // of each user's law, as it answered last
};

struct Viscous {  // C = -coefficient v on dofs, or on the slip velocities along a block
    int law = 0;  // index into Program::law_names
    int dof = -1, count = 0, block = -1;
    double coefficient = 0.0;
    int anchor = -1;  // block of the anchor that the block belongs to
    static constexpr int states = 0;
    static constexpr Reaction reaction = Reaction::none;

    template <class Sink>
    void act(const LawState& s, Sink& sink) const {
        if (block >= 0) {
            Vec3 force = Vec3::Zero();
            for (int k = 0; k < s.values[block].rows; ++k) force[k] = -coefficient * s.values[block].rate[k];
            return sink.along(block, force);
        }
        for (int k = dof; k < dof + count; ++k) sink.on_dof(k, -coefficient * s.v[k]);
    }
};

struct Sigmoid {  // identified robot friction, phi1/(1+exp(-phi2 (v+phi3))) - phi1/(1+exp(-phi2 phi3))
    int law = 0, dof = 0;
    double phi1 = 0.0, phi2 = 0.0, phi3 = 0.0;
    static constexpr int states = 0;
    static constexpr Reaction reaction = Reaction::none;

    template <class Real>
    Real level(const Real& speed) const {
        using std::exp;
        return phi1 / (1.0 + exp(-phi2 * (speed + phi3)));
    }
    template <class Sink>
    void act(const LawState& s, Sink& sink) const { sink.on_dof(dof, level(0.0) - level(s.v[dof])); }
};

struct LuGre {  // F = sigma0 z + sigma1 dz + sigma2 v, dz = v - sigma0 |v| z / g(v)
    int law = 0, dof = 0;
    double sigma0 = 0.0, sigma1 = 0.0, sigma2 = 0.0, coulomb = 0.0, stiction = 0.0, stribeck_velocity = 1.0;
    int state = 0;  // place of its first among the states of all laws, as Program::add gives it
    static constexpr int states = 1;
    static constexpr Reaction reaction = Reaction::none;

    template <class Real>
    Real rate(const Real& speed, const Real& z) const {
        using std::abs, std::exp;
        const Real x = speed / stribeck_velocity;
        const Real g = coulomb + (stiction - coulomb) * exp(-x * x);
        return speed - sigma0 * abs(speed) / g * z;
    }
    template <class Sink>
    void act(const LawState& s, Sink& sink) const {
        const double speed = s.v[dof], z = s.z[state], dz = rate(speed, z);
        sink.on_state(state, dz);
        sink.on_dof(dof, -(sigma0 * z + sigma1 * dz + sigma2 * speed));
    }
};

struct Drag {  // force -coefficient |u|^(exponent - 1) u at the origin of a frame
    int law = 0;
    Frame frame;
    double coefficient = 0.0, exponent = 1.0;
    static constexpr int states = 0;
    static constexpr Reaction reaction = Reaction::none;

    template <class Vector>
    Vector force(const Vector& u) const {
        using std::pow;
        return -coefficient * pow(u.norm(), exponent - 1.0) * u;
    }
    template <class Sink>
    void act(const LawState& s, Sink& sink) const {
        const Body& body = s.terms.body[frame.joint];
        const Vec3 x = body.ref + body.p + body.R * frame.p, u = velocity_at(body, x);
        if (frame.joint == 0) return;
        const Vec3 f = u.norm() == 0.0 ? u : force(u);
        sink.on_body(frame.joint, Force{f, (x - body.ref).cross(f)});
    }
};

struct UserLaw {
    int law = 0, index = 0, state = 0, states = 0;  // index: among the user's laws
    Reaction reaction = Reaction::none;
    // C (and dz when it has states) for provisional reactions held in the workspace.
    std::function<void(const Program& p, double t, const VecX& q, const VecX& v, Workspace& w, VecX& C, const double* z,
                       double* dz)> function;

    template <class Sink>
    void act(const LawState& s, Sink& sink) const { sink.on_all(s.user_force[index]); }
};

// Sums run kind by kind, in this order.
using Law = std::variant<Viscous, Sigmoid, LuGre, Drag, UserLaw>;

// Whether it has states of its own, and so a place for them.
template <class L, class = void>
constexpr bool has_states = false;
template <class L>
constexpr bool has_states<L, std::void_t<decltype(L::state)>> = true;

// What each law must say of itself, so that none is added and never acts.
template <class L>
constexpr bool is_complete_law() {
    static_assert(std::is_same_v<decltype(L::law), int>, "a law has `int law`, its column of the ledger");
    if constexpr (!std::is_same_v<L, UserLaw>) {  // which says these of each of its kind
        static_assert(L::reaction == Reaction::none, "reactions are solved for dry friction and for laws of the user");
        static_assert(has_states<L> == (L::states > 0), "a law with states has `int state`, the place of the first");
    }
    return true;
}
template <class... L>
constexpr bool all_laws_complete(const std::variant<L...>*) { return (is_complete_law<L>() && ...); }
static_assert(all_laws_complete(static_cast<const Law*>(nullptr)));

// Calls f(law) for each law of one kind.
template <class Kind, class Laws, class Function>
void each_law(Laws& laws, const Function& f) {
    for (auto& law : laws)
        if (auto* kind = std::get_if<Kind>(&law)) f(*kind);
}

}  // namespace pn
