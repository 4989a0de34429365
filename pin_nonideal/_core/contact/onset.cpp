#include "contact/onset.hpp"

#include <algorithm>
#include <cmath>

#include "contact/contact_rows.hpp"
#include "dynamics/friction_limit.hpp"
#include "dynamics/step_start.hpp"
#include "complementarity/cone/solver.hpp"
#include "contact/rest_of_trees.hpp"
#include "friction/stick_slip.hpp"
#include "math/tolerances.hpp"

namespace pn {

namespace {

constexpr double none = 1e-12;  // rounding relative to the scale of accelerations
constexpr double common_slip_rounding = 1e-14;  // rounding of a slip without own terms, relative to all accelerations
constexpr double min_other_motion = 1e-6;  // motion that differs from rest, relative to the scale of accelerations
constexpr double contact_limit_rounding = 1e-9;  // rounding relative to the limit of a force
constexpr double breaking_by = 1e-6;  // relative reduction of the limit of elements that just reached it
constexpr int most_releases = 4;  // rounds that set kinetic limits of slipping contacts
constexpr int max_load_iterations = 100;  // maximum iterations of loads and their friction
constexpr double settled = 1e-13;  // rounding of the loads' change, relative to the largest acceleration
constexpr int many = 8;  // contacts whose rest is first sought without the matrix of their responses

// Check if the cone problem applies. All friction must be sliding of contacts that grows from zero with the load, or have
// a constant limit. No user law may depend on reactions.
bool fits(const Program& p) {
    bool known = true;
    each_law<UserLaw>(p.laws, [&](const UserLaw& law) { known &= law.reaction == Reaction::none; });
    for (size_t e = 0; e < p.frictions.size(); ++e) {
        const Friction& f = p.frictions[e];
        const bool slides = f.gap >= 0 && p.gaps[f.gap].sliding == static_cast<int>(e) && f.constant == 0.0;
        const bool is_constant = f.gap < 0 && f.reaction == Reaction::none && f.mu == 0.0 && !f.user_limit;
        known &= (slides || is_constant) && static_cast<int>(p.blocks[f.block].kept.size()) == f.dim;
    }
    return known;
}

bool is_at_rest(const Program& p, const Workspace& w, const VecX& v, const ClosingQuestion& question,
                const RunState& before, int e) {
    const bool known = before.mode[e] == sticking || before.lingers[e];
    return e == question.arrived || (known && !question.struck) ||
           slip_velocity(w.now, p.frictions[e]).norm() <= rest_speed * (1.0 + v.cwiseAbs().maxCoeff());
}

// Coefficient of a contact, or limit of another element.
double strength(const Friction& f) { return f.gap >= 0 ? f.mu : f.constant; }

// Check if all contacts rest, and forces of the laws at rest hold them. Small problems need no help of this kind.
bool rests_at_once(const Program& p, Workspace& w, const VecX& v, const ClosingQuestion& question,
                   const std::vector<int>& gaps, const std::vector<int>& others) {
    if (static_cast<int>(gaps.size()) < many || !question.breaking.empty() || p.moves_in_time) return false;
    if ((v.array() != 0.0).any()) return false;
    std::vector<ConeElement> cones;
    for (int gap : gaps) {
        const int e = p.gaps[gap].sliding;
        if (e < 0) cones.push_back(ConeElement::contact(1, 0.0));
        else cones.push_back(ConeElement::contact(1 + p.frictions[e].dim, p.frictions[e].holding_limit(p.frictions[e].mu)));
    }
    for (int e : others)
        cones.push_back(ConeElement::box(p.frictions[e].dim, p.frictions[e].holding_limit(p.frictions[e].constant)));
    return rest_on_trees(p, w, gaps, others, cones);
}

struct RestingProblem {
    const Program& p;
    Workspace& w;
    const VecX& v;
    const ClosingQuestion& question;
    const RunState& before;
    ContactRows rows;
    std::vector<char> slides;            // contacts with a known slip direction
    std::vector<ConeElement> cones;      // cones of the contacts (slipping contacts: normal row only)
    std::vector<int> first;              // first row of each in the problem
    MatX drag;                           // friction of slipping contacts along all rows, per unknown
    MatX W, dragging;  // accelerations of the problem's rows for a unit of each unknown, and for its friction
    VecX w0, f;
    bool several = false;  // rest holds, though a motion was found too

    RestingProblem(const Program& program, Workspace& workspace, const VecX& velocity, const std::vector<int>& gaps,
                   const std::vector<int>& others, const ClosingQuestion& asked, const RunState& state)
        : p(program), w(workspace), v(velocity), question(asked), before(state),
          rows(program, workspace, gaps, true, others) {
        const int all = static_cast<int>(rows.W.rows());
        int n = 0;
        MatX share = MatX::Zero(all, all);
        drag = share;
        for (size_t i = 0; i < gaps.size(); ++i) {
            const int e = p.gaps[gaps[i]].sliding, at = rows.first[i], dim = rows.cones[i].dim;
            const bool slips = e >= 0 && dim > 1 && !is_at_rest(p, w, v, question, before, e);
            slides.push_back(slips);
            first.push_back(n);
            share(at, n) = 1.0;
            if (slips) {
                const Vec3 u = slip_velocity(w.now, p.frictions[e]);
                const double mu = p.frictions[e].kinetic_limit(p.frictions[e].mu, u.norm());
                for (int k = 1; k < dim; ++k) drag(at + k, n) = -mu * u[k - 1] / u.norm();
                cones.push_back(ConeElement::contact(1, 0.0));
            } else {
                for (int k = 1; k < dim; ++k) share(at + k, n + k) = 1.0;
                cones.push_back(ConeElement::contact(dim, e < 0 ? 0.0 : limit(e)));
            }
            n += cones.back().dim;
        }
        for (size_t i = gaps.size(); i < rows.cones.size(); ++i) {
            const int dim = rows.cones[i].dim;
            first.push_back(n);
            for (int k = 0; k < dim; ++k) share(rows.first[i] + k, n + k) = 1.0;
            cones.push_back(ConeElement::box(dim, limit(rows.element(i))));
            n += dim;
        }
        const VecX free = accelerations();
        W = chosen(rows.W * share.leftCols(n));
        dragging = chosen(rows.W * drag.leftCols(n));
        w0 = chosen(free);
        f.setZero(n);
    }

    // Select the rows of the problem from all rows.
    MatX chosen(const MatX& of_all) const {
        const int n = cones.empty() ? 0 : first.back() + cones.back().dim;
        MatX out(n, of_all.cols());
        for (size_t i = 0; i < cones.size(); ++i)
            out.middleRows(first[i], cones[i].dim) = of_all.middleRows(rows.first[i], cones[i].dim);
        return out;
    }

    double limit(int e) const {
        const std::vector<int>& list = question.breaking;
        const bool breaks = std::find(list.begin(), list.end(), e) != list.end();
        return p.frictions[e].holding_limit(strength(p.frictions[e])) * (breaks ? 1.0 - breaking_by : 1.0);
    }

    // Rows of a cone that belong to a normal.
    int head(size_t i) const { return cones[i].is(ConeElement::Kind::contact); }
    int tail(size_t i) const { return cones[i].dim - head(i); }
    auto tail_of(const VecX& x, size_t i) const { return x.segment(first[i] + head(i), tail(i)); }

    // Accelerations of the rows without contact forces.
    VecX accelerations() {
        VecX out = VecX::Zero(rows.W.rows());
        rows.each_row([&](int at, int block, int k) {
            multiply(p.blocks[block], w.now.A, w.now.a, w.scratch.r);
            out[at] = w.scratch.r[p.blocks[block].row + k] + w.now.values[block].drift[p.blocks[block].kept[k]];
        });
        return out;
    }

    double in_play() const { return w0.cwiseAbs().maxCoeff() + (W.cwiseAbs() * f.cwiseAbs()).maxCoeff(); }

    // Scale of the accelerations of some rows. That of all rows would hide the slip of a body beside much lighter ones.
    double in_play(int row, int count) const {
        if (count == 0) return 0.0;
        return w0.segment(row, count).cwiseAbs().maxCoeff() +
               (W.middleRows(row, count).cwiseAbs() * f.cwiseAbs()).maxCoeff();
    }
    // Accelerations of these rows, and of the slip of a cone, that are rounding.
    double rounding(int row, int count) const { return none * in_play(row, count) + common_slip_rounding * in_play(); }
    double slip_rounding(size_t i) const { return rounding(first[i] + head(i), tail(i)); }

    // Check if friction is at its limit. A contact that shares a load may have a load of rounding only.
    bool at_its_limit(size_t i) const {
        const double most = cones[i].bound * (head(i) ? f[first[i]] : 1.0), rounding = none * f.cwiseAbs().maxCoeff();
        return tail_of(f, i).norm() >= most * (1.0 - contact_limit_rounding) - rounding;
    }

    // Set the kinetic limit of contacts that slip from rest. Return true if any limit changed.
    bool release() {
        const VecX a = w0 + W * f;
        bool any = false;
        for (size_t i = 0; i < cones.size(); ++i) {
            const int e = rows.element(i);
            if (tail(i) == 0 || e < 0 || !at_its_limit(i)) continue;
            const double kinetic = p.frictions[e].kinetic_limit(strength(p.frictions[e]), 0.0);
            if (!(tail_of(a, i).norm() > slip_rounding(i)) || !(kinetic < cones[i].bound)) continue;
            cones[i].bound = kinetic;
            any = true;
        }
        return any;
    }

    bool solve(bool& shared) {
        const MatX plain = W;
        const VecX free = w0;
        W += dragging;
        if (!solve_cones(false, shared)) return false;
        if (!shared || dragging.isZero(0.0)) return true;
        const MatX coupled = W;
        const VecX found = f;
        W = plain;
        if (take_turns(free)) return true;
        W = coupled;
        w0 = free;
        f = found;
        return true;
    }

    bool moves() const {
        const VecX a = w0 + W * f;
        for (size_t i = 0; i < cones.size(); ++i)
            if ((head(i) && std::abs(a[first[i]]) > rounding(first[i], 1)) ||
                tail_of(a, i).norm() > slip_rounding(i))
                return true;
        return false;
    }

    // Rest is preferred to motion if both are possible.
    bool hold(ConeComplementarity& solver) {
        if (std::find(slides.begin(), slides.end(), char(1)) != slides.end()) return false;
        VecX holding(f.size());
        if (!solver.hold(W, w0, cones, holding)) return false;
        f = holding;
        return true;
    }

    bool solve_cones(bool warm, bool& shared) {
        ConeComplementarity solver;
        for (int round = 0; round < most_releases; ++round) {
            const bool solved = solver.solve(W, w0, cones, warm || round > 0, f) == ConeStatus::solved;
            if (round == 0 && !warm && (!solved || moves())) {
                const bool another = solved && (w0 + W * f).cwiseAbs().maxCoeff() > min_other_motion * in_play();
                if (hold(solver)) {
                    several = another;
                    break;
                }
            }
            if (!solved) return false;
            if (!release()) break;
        }
        shared = !solver.unique_shares();
        return true;
    }

    // Distribute loads as if friction was given, and iterate with the friction that they cause. Return false without
    // convergence.
    bool take_turns(const VecX& free) {
        bool shared = false;
        for (int turn = 0; turn < max_load_iterations; ++turn) {
            const VecX before = f;
            w0 = free + dragging * before;
            if (!solve_cones(true, shared)) return false;
            if ((dragging * (f - before)).cwiseAbs().maxCoeff() <= settled * in_play()) return true;
        }
        return false;
    }

    void read(RestingMotion& out) const {
        const VecX a = w0 + W * f;
        for (size_t i = 0; i < cones.size(); ++i) {
            const int e = rows.element(i);
            if (i < rows.gaps.size()) {
                const int gap = rows.gaps[i];
                out.closed[gap] = a[first[i]] <= none * in_play();
                out.loaded[gap] = out.closed[gap] && f[first[i]] > none * f.cwiseAbs().maxCoeff();
                if (e < 0 || !out.closed[gap]) continue;
                if (slides[i]) {
                    const Vec3 u = slip_velocity(w.now, p.frictions[e]);
                    out.modes[e] = p.frictions[e].dim > 1 || u[0] > 0.0 ? slip_plus : slip_minus;
                    out.direction[e] = (1.0 / u.norm()) * u;
                    continue;
                }
            }
            out.modes[e] = sticking;
            const VecX friction = tail_of(f, i), slip = tail_of(a, i);
            for (int k = 0; k < tail(i); ++k) out.friction[e][k] = friction[k];
            if (tail(i) == 0 || !at_its_limit(i) || !(slip.norm() > slip_rounding(i))) continue;
            // At a slow slip onset the force defines the direction more accurately than the acceleration.
            const bool tells = friction.norm() > none * f.cwiseAbs().maxCoeff();
            const VecX way = tells ? VecX(-friction.normalized()) : VecX(slip.normalized());
            for (int k = 0; k < slip.size(); ++k) out.direction[e][k] = way[k];
            out.modes[e] = p.frictions[e].dim > 1 || way[0] > 0.0 ? slip_plus : slip_minus;
        }
    }
};

}  // namespace

bool RestingMotion::slides() const {
    return std::any_of(modes.begin(), modes.end(), [](Mode mode) { return slips(mode); });
}

void RestingMotion::answer(const Program& p, Workspace& w, ModeQuestion& question) const {
    if (is_near) {
        question.near = friction;
        return;
    }
    for (int e : question.at_rest) {
        question.modes[e] = modes[e];
        if (p.frictions[e].dim > 1 && slips(modes[e])) w.state.slip_direction[e] = w.state.last_direction[e] = direction[e];
    }
    question.answered = true;
    question.several = several;
}

namespace {

// Call act(problem) with the contacts of `question.rest` and the other elements at rest as a cone problem, or
// rest(elements) if they rest at once. The workspace is unchanged afterwards. Return false if they are no cone problem,
// or if other rows admit no motion.
template <class Rest, class Act>
bool with_problem(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, const ClosingQuestion& question,
                  const Rest& rest, const Act& act) {
    std::vector<int> gaps;
    for (int i = 0; i < static_cast<int>(p.gaps.size()); ++i)
        if (question.rest[i]) gaps.push_back(i);
    if (gaps.empty() || !fits(p)) return false;
    const RunState before = w.state;
    std::vector<int> others;  // at rest
    std::vector<Mode> modes(p.frictions.size(), unloaded);
    for (int e = 0; e < static_cast<int>(p.frictions.size()); ++e) {
        if (p.frictions[e].gap >= 0) continue;
        if (is_at_rest(p, w, v, question, before, e)) others.push_back(e);
        else if (p.frictions[e].dim > 1) return false;
        else modes[e] = slip_velocity(w.now, p.frictions[e])[0] > 0.0 ? slip_plus : slip_minus;
    }
    bool found = false;
    try {
        release_contacts(p, w, t, q, v, question.rest, modes);
        if (rests_at_once(p, w, v, question, gaps, others)) {
            rest(others);
            found = true;
        } else {
            RestingProblem problem(p, w, v, gaps, others, question, before);
            found = act(problem);
        }
    } catch (const Failure& failure) {  // the caller's own evaluation reports failures of other rows
        if (failure.kind == Failure::Kind::interrupted) throw;
    }
    set_closed(p, w, before.closed);
    set_modes(p, w, before.mode);
    w.state = before;
    return found;
}

}  // namespace

std::optional<RestingMotion> resting_motion(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v,
                                            const ClosingQuestion& question) {
    const std::vector<char> open(p.gaps.size(), 0);
    RestingMotion out{open, open, std::vector<Mode>(p.frictions.size(), unloaded),
                      std::vector<Vec3>(p.frictions.size(), Vec3::Zero()), {}};
    out.friction = out.direction;
    const auto rest = [&](const std::vector<int>& others) {
        out.closed = out.loaded = question.rest;
        for (size_t i = 0; i < p.gaps.size(); ++i)
            if (question.rest[i] && p.gaps[i].sliding >= 0) out.modes[p.gaps[i].sliding] = sticking;
        for (int e : others) out.modes[e] = sticking;
        out.shared = true;
    };
    const bool found = with_problem(p, w, t, q, v, question, rest, [&](RestingProblem& problem) {
        if (!problem.solve(out.shared)) return false;
        problem.read(out);
        out.several = problem.several;
        return true;
    });
    if (!found) return std::nullopt;
    return out;
}

bool closed_contacts_hold(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v) {
    ClosingQuestion question;
    question.rest = w.state.closed;
    return with_problem(p, w, t, q, v, question, [](const std::vector<int>&) {}, [](RestingProblem& problem) {
        ConeComplementarity solver;
        return problem.hold(solver);
    });
}

}  // namespace pn
