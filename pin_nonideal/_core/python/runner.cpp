#include "python/runner.hpp"

#include <algorithm>
#include <chrono>
#include <numeric>

#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "constraints/row_length.hpp"
#include "contact/active_set.hpp"
#include "contact/touching_contacts.hpp"
#include "dynamics/evaluation.hpp"
#include "dynamics/state_projection.hpp"
#include "dynamics/friction_limit.hpp"
#include "dynamics/reported_loads.hpp"
#include "dynamics/step_start.hpp"
#include "friction/stick_slip.hpp"
#include "python/buffers.hpp"
#include "python/reused_workspace.hpp"
#include "python/options.hpp"
#include "tree/mass_factor.hpp"
#include "tree/lie_group.hpp"

using namespace nanobind::literals;

namespace pn {

namespace {

// Return a block with all rows of its description. `copy` stores it if some rows are not kept.
const Block& with_all_rows(const Block& block, Block& copy) {
    if (static_cast<int>(block.kept.size()) == block.total) return block;
    copy = block;
    copy.kept.resize(block.total);
    std::iota(copy.kept.begin(), copy.kept.end(), 0);
    return copy;
}

}  // namespace

Runner::Runner(std::shared_ptr<const Program> program)
    : p(std::move(program)), w(std::make_unique<Workspace>(*p)), first(w->state), q(p->mechanism.nq),
      v(p->mechanism.nv) {}

void Runner::set(const Array& q_in, const Array& v_in, const std::optional<Array>& tau) {
    const Mechanism& m = p->mechanism;
    const auto holds = [](const Array& x, int n) { return x.shape(0) == static_cast<size_t>(n); };
    if (!holds(q_in, m.nq) || !holds(v_in, m.nv) || !has_unit_lengths(m, q_in.data(), unit_tolerance))
        throw std::invalid_argument("q or v does not fit the model");
    q = map(q_in);
    v = map(v_in);
    w->now.has_override = tau.has_value();
    if (!tau) return;
    if (!holds(*tau, m.nv)) throw std::invalid_argument("tau does not fit the model");
    w->now.override_torque = map(*tau);
}

void Runner::read_directions(const Array& directions) {
    directions_.assign(p->frictions.size(), Vec3::Zero());
    size_t first = 0;
    for (size_t e = 0; e < directions_.size(); ++e) {
        const auto size = static_cast<size_t>(p->frictions[e].dim);
        if (first + size > directions.shape(0)) throw std::invalid_argument("directions do not fit the friction elements");
        std::copy_n(directions.data() + first, size, &directions_[e][0]);
        first += size;
    }
}

void Runner::choose_modes(double t, const std::optional<std::vector<Mode>>& modes) {
    state_.open.clear();
    is_choice_unique_ = true;
    if (!p->gaps.empty()) choose_contacts(t, modes);
    else choose_friction(t, modes, nullptr);
}

// Close the touching contacts that do not separate and carry nonnegative loads. Given modes apply to all elements.
void Runner::choose_contacts(double t, const std::optional<std::vector<Mode>>& modes) {
    set_closed(*p, *w, std::vector<char>(p->gaps.size(), 0));
    OnsetQuery query;
    query.rest = touching_contacts(*p, *w, t, q, v, true).rest;
    query.after_impact = true;
    query.prescribed = modes.has_value();
    is_choice_unique_ = modes || is_choice_unique(*p, *w, t, q, v, query);
    select_active_contacts(*p, *w, t, q, v, query, [&](const OnsetMotion* joint_motion) {
        update_kinematics(*p, *w, t, q, v);
        choose_friction(t, modes, joint_motion);
    });
    for (size_t i = 0; i < query.rest.size(); ++i)
        if (query.rest[i] && !w->state.closed[i]) state_.open.push_back(static_cast<int>(i));
    if (!modes && !slip_opposes_friction(*p, *w, v)) throw Failure(Failure::Kind::not_converged, t, w->now.slipping);
}

void Runner::choose_friction(double t, const std::optional<std::vector<Mode>>& modes, const OnsetMotion* joint_motion) {
    ModeQuery mode_query = make_first_mode_query(*p, *w, t, q, v);  // sets the slip directions, too
    if (!modes) {
        if (joint_motion) joint_motion->to_modes(*p, *w, mode_query);
        return resolve_modes(*p, *w, t, q, v, mode_query);
    }
    if (w->state.solves_directions) w->state.last_direction = directions_;
    set_modes(*p, *w, *modes);
    w->state.warm = false;
    begin_step(*p, *w, t, q, v);
}

void Runner::acceleration(nb::handle q_in, nb::handle v_in, double t, nb::handle tau, nb::handle out) {
    read_buffer(q_in, q);
    if (!has_unit_lengths(p->mechanism, q.data(), unit_tolerance))
        throw std::invalid_argument("q holds a part that is not of unit length");
    read_buffer(v_in, v);
    if (!std::isfinite(t)) throw std::invalid_argument("expected a finite time");
    w->now.has_override = !tau.is_none();
    if (w->now.has_override) read_buffer(tau, w->now.override_torque);
    if (p->frictions.empty() && p->gaps.empty()) begin_step(*p, *w, t, q, v);
    else choose_modes(t, {});
    const NumberBuffer target(out, PyBUF_WRITABLE);
    target.check(w->now.a.size());
    std::copy(w->now.a.data(), w->now.a.data() + w->now.a.size(), target.data());
}

namespace {

// Guard that sets a flag during its lifetime.
class FlagGuard {
public:
    FlagGuard(bool& flag, bool value) : flag_(flag) { flag_ = value; }
    ~FlagGuard() { flag_ = false; }
    FlagGuard(const FlagGuard&) = delete;
    FlagGuard& operator=(const FlagGuard&) = delete;

private:
    bool& flag_;
};

}  // namespace

Instant Runner::solve(const Array& q_in, const Array& v_in, double t, const std::optional<Array>& tau,
                      const std::optional<std::vector<Mode>>& modes, bool frozen,
                      const std::optional<Array>& directions) {
    set(q_in, v_in, tau);
    const FlagGuard stands_still(w->now.frozen, frozen);
    const FlagGuard knows_directions(w->state.solves_directions, directions.has_value());
    if (directions) read_directions(*directions);
    choose_modes(t, modes);
    if (!modes) {
        const LawResiduals laws = check_laws(*p, *w, t, q, v, state_);
        if (!laws.are_small()) throw laws.failure(t);
    }
    const Uniqueness unique = w->now.several ? Uniqueness::several : w->state.unique;
    const ReportedLoads loads(*p, *w);
    Instant out;
    for (size_t e = 0; e < p->frictions.size(); ++e) {
        const int element = static_cast<int>(e);
        const Mode mode = w->state.mode[e];
        Vec3 f = friction_force(*p, *w, element);
        out.friction.push_back(to_numpy(&f[0], p->frictions[e].dim));
        out.limits.push_back(current_limit(*p, *w, element, t, q, v));
        out.modes.push_back(mode);
    }
    Split split;
    split_forces(*p, *w, split);
    append_closed(*p, *w, out.closed);
    out.a = to_numpy(w->now.a);
    out.F_ideal = to_numpy(split.F_ideal);
    out.F_nonideal = to_numpy(split.F_nonideal);
    out.C = to_numpy(split.C);
    out.F = to_numpy(w->now.F);
    out.lam = to_numpy(split.lam);
    out.lam_ideal = to_numpy(split.lam_ideal);
    out.rank = constraint_rank();
    if (unique == Uniqueness::several) out.unique = false;
    else if (unique == Uniqueness::shown && is_choice_unique_) out.unique = true;
    return out;
}

int Runner::constraint_rank() const {
    int rank = 0;
    for (int i = 0; i < p->constraints; ++i)
        for (size_t k = 0; k < p->blocks[i].kept.size(); ++k) rank += w->now.rows.active[p->blocks[i].row + k];
    return rank;
}

std::vector<int> Runner::chosen_blocks(const std::optional<std::vector<int>>& blocks) const {
    if (blocks) {
        for (const int i : *blocks)
            if (i < 0 || i >= p->constraints) throw std::invalid_argument("no such block");
        return *blocks;
    }
    std::vector<int> all(p->constraints);
    std::iota(all.begin(), all.end(), 0);
    std::sort(all.begin(), all.end(), [&](int i, int j) { return p->blocks[i].user_row < p->blocks[j].user_row; });
    return all;
}

std::tuple<Numbers, Numbers, Numbers, Numbers> Runner::rows(const Array& q_in, const Array& v_in, double t,
                                                            const std::optional<std::vector<int>>& chosen) {
    set(q_in, v_in, {});
    const Mechanism& m = p->mechanism;
    kinematics(m, w->now.terms, q, v);
    const std::vector<int> blocks = chosen_blocks(chosen);
    size_t count = 0;
    for (const int i : blocks) count += p->blocks[i].total;
    std::vector<double> A(count * m.nv, 0.0), b(count), phi = b, rate = b, local;
    Block copy;
    size_t row = 0;
    for (const int i : blocks) {
        evaluate_block(*p, *w, t, v, i);
        const Block& all = with_all_rows(p->blocks[i], copy);
        const RowValues& values = w->now.values[i];
        local.assign(all.support().size() * all.total, 0.0);
        fill_A(all, m, w->now.terms, values, local.data());
        for (int k = 0; k < all.total; ++k, ++row) {
            for (size_t l = 0; l < all.support().size(); ++l) A[row * m.nv + all.support()[l]] = local[l * all.total + k];
            b[row] = -values.bias[k];
            phi[row] = values.residual[k];
            rate[row] = values.rate[k];
        }
    }
    return {to_numpy(std::move(A)), to_numpy(std::move(b)), to_numpy(std::move(phi)), to_numpy(std::move(rate))};
}

Numbers Runner::residuals(const Array& q_in, const Array& v_in, double t) {
    set(q_in, v_in, {});
    kinematics(p->mechanism, w->now.terms, q, v);
    std::vector<double> phi(p->user_rows);
    RowValues gap;  // storage of all gaps, one after another
    for (int i = 0; i < p->constraints; ++i) {
        const Block& block = p->blocks[i];
        const bool is_users = std::holds_alternative<UserRows>(block.kind) || std::holds_alternative<UserGapRow>(block.kind);
        RowValues& values = is_users || i < p->first_gap ? w->now.values[i] : gap;
        if (is_users) {
            evaluate_block(*p, *w, t, v, i);
        } else {
            if (&values == &gap) gap.resize(RowStorage(block.kind), p->mechanism.nv);
            const State state{p->mechanism, w->now.terms, w->now.row_time(t), w->now.terms.q, v};
            evaluate(block.kind, state, Part::residual, values);
        }
        std::copy_n(values.residual.begin(), block.total, phi.begin() + block.user_row);
    }
    return to_numpy(std::move(phi));
}

Numbers Runner::row_lengths(const Array& q_in, const Array& v_in, double t, bool own,
                            const std::optional<std::vector<int>>& chosen) {
    set(q_in, v_in, {});
    set_modes(*p, *w, std::vector<Mode>(p->frictions.size(), unloaded));  // no joint is locked
    configure(*p, *w, t, q, v);
    std::vector<double> lengths;
    const auto append = [&](int i, int count) {
        const Block& block = p->blocks[i];
        std::vector<int> rows(block.total);
        std::iota(rows.begin(), rows.end(), 0);
        evaluate_block(*p, *w, t, v, i);  // also for open contacts
        lengths.resize(lengths.size() + count);
        double* last = lengths.data() + lengths.size() - count;
        (own ? own_lengths : greatest_lengths)(p->mechanism, w->now.terms, block, rows, w->now.values[i], last);
    };
    for (const int i : chosen_blocks(chosen)) append(i, p->blocks[i].total);
    if (!chosen)
        for (const Friction& f : p->frictions) append(f.block, f.dim);
    return to_numpy(std::move(lengths));
}

Numbers Runner::slip_rows(const Array& q_in, const Array& v_in, double t) {
    set(q_in, v_in, {});
    kinematics(p->mechanism, w->now.terms, q, v);
    const int nv = p->mechanism.nv;
    std::vector<double> rows;
    for (const Friction& f : p->frictions) {
        const Block& block = p->blocks[f.block];
        evaluate_block(*p, *w, t, v, f.block);  // also for open contacts
        std::vector<double> local(block.support().size() * f.dim);
        fill_A(block, p->mechanism, w->now.terms, w->now.values[f.block], local.data());
        for (int k = 0; k < f.dim; ++k) {
            rows.resize(rows.size() + nv, 0.0);
            for (size_t l = 0; l < block.support().size(); ++l)
                rows[rows.size() - nv + block.support()[l]] = local[l * f.dim + k];
        }
    }
    return to_numpy(std::move(rows));
}

std::pair<Numbers, Numbers> Runner::terms(const Array& q_in, const Array& v_in) {
    set(q_in, v_in, {});
    kinematics(p->mechanism, w->now.terms, q, v);
    inertia(p->mechanism, w->now.terms);
    const Mechanism& m = p->mechanism;
    std::vector<double> M(static_cast<size_t>(m.nv) * m.nv, 0.0);
    VecX unit = VecX::Zero(m.nv), column = unit;
    for (int k = 0; k < m.nv; ++k) {
        unit[k] = 1.0;
        multiply_M(m, w->now.terms, unit, column);
        std::copy(column.data(), column.data() + m.nv, M.begin() + static_cast<size_t>(k) * m.nv);
        unit[k] = 0.0;
    }
    return {to_numpy(std::move(M)), to_numpy(w->now.terms.nle)};
}

std::pair<double, double> Runner::energies(const Array& q_in, const Array& v_in) {
    set(q_in, v_in, {});
    kinematics(p->mechanism, w->now.terms, q, v);
    inertia(p->mechanism, w->now.terms);
    return {kinetic_energy(p->mechanism, w->now.terms, v), potential_energy(p->mechanism, w->now.terms)};
}

std::tuple<Numbers, Numbers, double, double, double> Runner::project(const Array& q_in, const Array& v_in, double t,
                                                                     double max_residual) {
    set(q_in, v_in, {});
    const Closure found = close(*p, *w, t, q, v, max_residual);
    return {to_numpy(q), to_numpy(v), found.before, found.after, found.rate};
}

Options& Runner::read(const nb::object& run_options) {
    if (!last_options.is(run_options)) {
        run_.reset();  // the kept run uses the old options
        last_options.reset();
        options = nb::cast<Options>(run_options);
        last_options = run_options;
    }
    return options;
}

// Check if a run records only samples of states. The object of such a run is kept for the next call, because programs
// often make very many short runs with the same options.
static bool is_plain(const Options& o) {
    return !o.record.evaluates() && !o.record.dense && o.max_wall == 0.0 && o.events.empty() &&
           !o.callback && !o.save;
}

Outcome Runner::simulate(const Array& q_in, const Array& v_in) {
    const VecX q0 = map(q_in), v0 = map(v_in);
    Outcome outcome;
    {
        nb::gil_scoped_release release;
        if (is_plain(options)) {
            run_.run_from(*p, *w, first, options, q0, v0);
            outcome.recording = std::exchange(run_.out, {});
        } else {
            run_.reset();
            reset_workspace(*p, *w, first);
            pn::simulate(*p, *w, q0, v0, options, outcome.recording);
        }
    }
    outcome.counters = w->counters;
    options.tick = nullptr;
    options.hint = nullptr;
    options.save = nullptr;
    options.callback = nullptr;
    options.events.clear();
    return outcome;
}

Outcome Runner::resume(const nb::bytes& state, const Options& with) {
    const std::string bytes(static_cast<const char*>(state.data()), state.size());
    Recording recording;
    run_.reset();  // the kept run uses the old workspace
    w = std::make_unique<Workspace>(*p);
    {
        nb::gil_scoped_release release;
        pn::resume(*p, *w, bytes, with, recording);
    }
    return {w->counters, std::move(recording)};
}

std::vector<std::pair<double, int>> Runner::law_residuals(const Array& q_in, const Array& v_in, double t,
                                                          const std::optional<Array>& tau,
                                                          const std::optional<std::vector<Mode>>& modes,
                                                          const std::optional<Array>& a, const std::optional<Array>& loads,
                                                          const std::optional<std::vector<Array>>& friction) {
    set(q_in, v_in, tau);
    choose_modes(t, modes);
    MotionForces forces = motion_forces(*p, *w, t, q, v);
    if (loads && loads->shape(0) != p->gaps.size()) throw std::invalid_argument("loads do not fit the contacts");
    for (size_t i = 0; loads && i < p->gaps.size(); ++i) {
        const Block& block = p->blocks[p->gaps[i].block];
        if (w->state.closed[i] && !block.kept.empty()) forces.lam[block.row] = forces.shared_lam[block.row] = (*loads)(i);
    }
    if (friction && friction->size() != p->frictions.size()) throw std::invalid_argument("friction does not fit");
    for (size_t e = 0; friction && e < friction->size(); ++e)
        for (int k = 0; k < p->frictions[e].dim; ++k)
            forces.friction[e][k] = forces.shared_friction[e][k] = (*friction)[e](k);
    const VecX acceleration = a ? VecX(map(*a)) : w->now.a;
    const LawResiduals r = pn::law_residuals(*p, *w, t, v, acceleration, forces, state_);
    return {{r.motion.size, r.motion.index}, {r.signorini.size, r.signorini.index},
            {r.coulomb.size, r.coulomb.index}, {r.dissipation.size, r.dissipation.index}};
}

double Runner::time_evaluations(const Array& q_in, const Array& v_in, double t, int count) {
    set(q_in, v_in, {});
    choose_modes(t, {});
    const auto begin = std::chrono::steady_clock::now();
    for (int i = 0; i < count; ++i) evaluate(*p, *w, t, q, v);
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() / count;
}

nb::class_<Runner> bind_runner(nb::module_& m) {
    constexpr auto own = nb::rv_policy::automatic;  // arrays that own their numbers
    nb::class_<Instant>(m, "Instant")
        .def_ro("a", &Instant::a, own)
        .def_ro("F_ideal", &Instant::F_ideal, own)
        .def_ro("F_nonideal", &Instant::F_nonideal, own)
        .def_ro("C", &Instant::C, own)
        .def_ro("F", &Instant::F, own)
        .def_ro("lam", &Instant::lam, own)
        .def_ro("lam_ideal", &Instant::lam_ideal, own)
        .def_ro("rank", &Instant::rank)
        .def_ro("modes", &Instant::modes)
        .def_ro("closed", &Instant::closed)
        .def_ro("friction", &Instant::friction, own)
        .def_ro("limits", &Instant::limits)
        .def_ro("unique", &Instant::unique);
    nb::class_<Runner> runner(m, "Runner");
    runner
        .def("acceleration", &Runner::acceleration, "q"_a, "v"_a, "t"_a, "tau"_a.none(), "out"_a)
        .def("solve", &Runner::solve, "q"_a, "v"_a, "t"_a = 0.0, "tau"_a = nb::none(), "modes"_a = nb::none(),
             "frozen"_a = false, "directions"_a = nb::none())
        .def("rows", &Runner::rows, "q"_a, "v"_a, "t"_a, "blocks"_a = nb::none())
        .def("residuals", &Runner::residuals, "q"_a, "v"_a, "t"_a)
        .def("row_lengths", &Runner::row_lengths, "q"_a, "v"_a, "t"_a, "own"_a = false, "blocks"_a = nb::none())
        .def("slip_rows", &Runner::slip_rows, "q"_a, "v"_a, "t"_a)
        .def("terms", &Runner::terms, "q"_a, "v"_a)
        .def("energies", &Runner::energies, "q"_a, "v"_a)
        .def("project", &Runner::project, "q"_a, "v"_a, "t"_a, "max_residual"_a)
        .def("law_residuals", &Runner::law_residuals, "q"_a, "v"_a, "t"_a = 0.0, "tau"_a = nb::none(),
             "modes"_a = nb::none(), "a"_a = nb::none(), "loads"_a = nb::none(), "friction"_a = nb::none())
        .def("time_evaluations", &Runner::time_evaluations, "q"_a, "v"_a, "t"_a, "count"_a)
        .def_prop_ro("rank", &Runner::constraint_rank)
        // If several motions are possible: true takes the one nearest to the last motion, false raises.
        .def_prop_rw("continues", [](Runner& r) { return r.w->continues; }, [](Runner& r, bool on) { r.w->continues = on; })
        // Last factorization of the rows: smallest pivot, orthogonal factorization used, redundant, refined.
        .def_prop_ro("factorization", [](Runner& r) {
            const RowSystem& s = r.w->now.rows;
            return std::make_tuple(s.min_pivot, s.orthogonal, s.redundant, s.refine);
        });
    return runner;
}

}  // namespace pn
