// Nonideal laws, which form C(q, v, t, reactions) of Eq. (9), w^T F^c = w^T C.
//
// Each smooth law is one struct. The function `act` of a law exerts forces on dofs, on bodies or along the rows of a block,
// and sets the rates of its states. The same function computes C and, if joints carry the forces, the reactions. Dry
// friction, with sticking and slipping elements, is in friction.hpp.
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

// Reactions that a law reads: none, those of the ideal constraints alone, or those of the motion that the law causes.
enum class Reaction { none, ideal, total };

// Quantities that a law may read at a state.
struct LawState {
    const Terms& terms;
    const BlockValues& values;  // rates of each block
    const VecX& v;
    const VecX& z;
    const std::vector<VecX>& user_force;  // last result of each user-defined law
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
    // Change of the force with the speed.
    double slope(double speed) const { return phi2 * level(speed) * (1.0 - level(speed) / phi1); }
    template <class Sink>
    void act(const LawState& s, Sink& sink) const { sink.on_dof(dof, level(0.0) - level(s.v[dof])); }
};

struct LuGre {  // F = sigma0 z + sigma1 dz + sigma2 v, dz = v - sigma0 |v| z / g(v)
    int law = 0, dof = 0;
    double sigma0 = 0.0, sigma1 = 0.0, sigma2 = 0.0, coulomb = 0.0, stiction = 0.0, stribeck_velocity = 1.0;
    int state = 0;  // index of its first state among the states of all laws, set by Program::add
    static constexpr int states = 1;
    static constexpr Reaction reaction = Reaction::none;

    template <class Real>
    Real rate(const Real& speed, const Real& z) const { return speed - decay(speed) * z; }
    // Rate sigma0 |v| / g(v) at which the deflection decays to its limit.
    template <class Real>
    Real decay(const Real& speed) const {
        using std::abs, std::exp;
        const Real x = speed / stribeck_velocity;
        return sigma0 * abs(speed) / (coulomb + (stiction - coulomb) * exp(-x * x));
    }
    // Mean of the deflection over the time h after z0 at constant speed. Its rate is the mean rate.
    double mean_deflection(double speed, double z0, double h) const {
        constexpr double slow = 1e-3;  // decay below which the series is accurate to 1e-14
        const double x = h * decay(speed), tail = x / 3.0 * (1.0 - x / 4.0 * (1.0 - x / 5.0));
        const double kept = x < slow ? 1.0 - 0.5 * x * (1.0 - tail) : -std::expm1(-x) / x;
        const double moved = x < slow ? 0.5 * (1.0 - tail) : (1.0 - kept) / x;
        return kept * z0 + moved * h * speed;
    }
    // Deflection after the time h at constant speed.
    double deflection_after(double speed, double z0, double h) const {
        return z0 + h * rate(speed, mean_deflection(speed, z0, h));
    }
    // Force that opposes the speed.
    double resistance(double speed, double z) const { return sigma0 * z + sigma1 * rate(speed, z) + sigma2 * speed; }
    template <class Sink>
    void act(const LawState& s, Sink& sink) const {
        const double speed = s.v[dof], z = s.z[state];
        sink.on_state(state, rate(speed, z));
        sink.on_dof(dof, -resistance(speed, z));
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
    int law = 0, index = 0, state = 0, states = 0;  // index: number among the user-defined laws
    Reaction reaction = Reaction::none;
    // Computes C (and dz if the law has states) for provisional reactions in the workspace.
    std::function<void(const Program& p, double t, const VecX& q, const VecX& v, Workspace& w, VecX& C, const double* z,
                       double* dz)> function;

    template <class Sink>
    void act(const LawState& s, Sink& sink) const { sink.on_all(s.user_force[index]); }
};

// The forces of all laws of one kind are added before those of the next kind, in this order.
using Law = std::variant<Viscous, Sigmoid, LuGre, Drag, UserLaw>;

// Check if a law has a member `state`, the index of its first state.
template <class L, class = void>
constexpr bool has_states = false;
template <class L>
constexpr bool has_states<L, std::void_t<decltype(L::state)>> = true;

// Check at compile time that a law declares its members. A law without them would be added but never act.
template <class L>
constexpr bool is_complete_law() {
    static_assert(std::is_same_v<decltype(L::law), int>, "a law has `int law`, its column of the ledger");
    if constexpr (!std::is_same_v<L, UserLaw>) {  // a UserLaw declares these members per object
        static_assert(L::reaction == Reaction::none, "reactions are solved for dry friction and for laws of the user");
        static_assert(has_states<L> == (L::states > 0), "a law with states has `int state`, the place of the first");
    }
    return true;
}
template <class... L>
constexpr bool all_laws_complete(const std::variant<L...>*) { return (is_complete_law<L>() && ...); }
static_assert(all_laws_complete(static_cast<const Law*>(nullptr)));

// Call f(law) for each law of one kind.
template <class Kind, class Laws, class Function>
void each_law(Laws& laws, const Function& f) {
    for (auto& law : laws)
        if (auto* kind = std::get_if<Kind>(&law)) f(*kind);
}

}  // namespace pn
