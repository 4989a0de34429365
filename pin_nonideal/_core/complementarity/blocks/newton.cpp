#include "complementarity/blocks/newton.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace pn {

void BlockNewton::pose(const BlockProblem& p) {
    rho_.assign(p.rows, 0.0);
    root_rho_.assign(p.rows, 0.0);
    unit_force_.assign(p.rows, 0.0);
    G_.assign(9 * p.elements.size(), 0.0);
    piece_.assign(p.elements.size(), Piece::unknown);
    there_.resize(p.elements.size());
    for (VecX* x : {&y_, &e_, &z_, &df_, &dw_, &f_full_, &w_full_, &f_part_, &w_part_, &f_best_}) x->resize(p.rows);
    int unknowns = 0;
    for (const BlockNode& node : p.nodes) unknowns = std::max(unknowns, node.first + node.size);
    dx_.resize(unknowns);
    x_full_.resize(unknowns);
    listed_.resize(p.elements.size());
    std::iota(listed_.begin(), listed_.end(), 0);
    responses_.resize(p.elements.size());
    p.own_responses(listed_, responses_);
    for (size_t i = 0; i < p.elements.size(); ++i) {
        const BlockElement& e = p.elements[i];
        const Mat3& W = responses_[i];
        const int head = e.head(), tail = e.dim() - head;
        const double normal = head ? W.c[0][0] : 0.0;
        double across = 0.0;
        for (int k = head; k < e.dim(); ++k) across += W.c[k][k] / tail;
        const double most = std::max(normal, across);
        const auto inverse = [&](double own) {
            return most > 0.0 ? 1.0 / (own > min_block_response * most ? own : most) : 1.0;
        };
        for (int k = 0; k < e.dim(); ++k) {
            rho_[e.row + k] = inverse(k < head ? normal : across);
            root_rho_[e.row + k] = std::sqrt(rho_[e.row + k]);
            unit_force_[e.row + k] = 1.0 / root_rho_[e.row + k];
        }
    }
}

void BlockNewton::move(const BlockProblem& p, const Island& island, const VecX& f, VecX& x, VecX& w) const {
    for (int n : island.nodes) x.segment(p.nodes[n].first, p.nodes[n].size).setZero();
    p.push(island.elements, f, x);
    for (int n : island.nodes) {
        p.solve_mass(n, x);
        x.segment(p.nodes[n].first, p.nodes[n].size) += p.free.segment(p.nodes[n].first, p.nodes[n].size);
    }
    p.respond(island.elements, x, w);
    for (int i : island.elements)
        for (int k = p.elements[i].row; k < p.elements[i].row + p.elements[i].dim(); ++k) w[k] += p.offset[k];
}

BlockNewton::Projection BlockNewton::projection(const BlockElement& e, const double* y) const {
    Projection out;
    const int head = e.head(), d = e.dim();
    double radius = e.cone.bound;
    if (e.cone.is(ConeKind::equality)) {
        out.piece = Piece::sticks;
        std::copy(y, y + d, out.P);
        return out;
    }
    if (head) {
        if (!(y[0] > 0.0)) return out;
        out.P[0] = y[0];
        radius *= y[0];
    }
    double square = 0.0;
    for (int k = head; k < d; ++k) square += y[k] * y[k];
    const double length = std::sqrt(square);
    if (length <= radius || d == head) {
        out.piece = Piece::sticks;
        std::copy(y + head, y + d, out.P + head);
        return out;
    }
    out.piece = Piece::slips;
    out.ratio = radius / length;
    for (int k = head; k < d; ++k) {
        out.t[k] = y[k] / length;
        out.P[k] = radius * out.t[k];
    }
    return out;
}

bool BlockNewton::project(const BlockProblem& p, const Island& island, VecX& f) const {
    bool changes = false;
    for (int i : island.elements) {
        const BlockElement& e = p.elements[i];
        const Projection there = projection(e, f.data() + e.row);
        for (int k = 0; k < e.dim(); ++k) {
            changes |= f[e.row + k] != there.P[k];
            f[e.row + k] = there.P[k];
        }
    }
    return changes;
}

void BlockNewton::sweep(const BlockProblem& p, const Island& island, int sweeps, VecX& f, VecX& x, VecX& w) {
    move(p, island, f, x, w);
    for (int sweep = 0; sweep < sweeps; ++sweep)
        for (int i : island.elements) {
            const BlockElement& e = p.elements[i];
            p.respond(e, x, w);
            for (int r = e.row; r < e.row + e.dim(); ++r) y_[r] = f[r] - rho_[r] * (w[r] + p.offset[r]);
            const Projection there = projection(e, y_.data() + e.row);
            for (int k = 0; k < e.dim(); ++k) {
                df_[e.row + k] = there.P[k] - f[e.row + k];
                f[e.row + k] = there.P[k];
            }
            for (int n : e.node)
                if (n >= 0) dx_.segment(p.nodes[n].first, p.nodes[n].size).setZero();
            p.push(e, df_, dx_);
            for (int n : e.node) {
                if (n < 0) continue;
                p.solve_mass(n, dx_);
                x.segment(p.nodes[n].first, p.nodes[n].size) += dx_.segment(p.nodes[n].first, p.nodes[n].size);
            }
        }
    move(p, island, f, x, w);
}

// Evaluate the errors e and their squared length in units of energy. Return the largest error of an element relative to
// its forces, or to those of the largest free velocity.
double BlockNewton::evaluate(const BlockProblem& p, const Island& island, const VecX& f, const VecX& w, double& merit) {
    merit = 0.0;
    double worst = 0.0;
    for (int i : island.elements) {
        const BlockElement& e = p.elements[i];
        for (int r = e.row; r < e.row + e.dim(); ++r) y_[r] = (1.0 - compliance_) * f[r] - rho_[r] * w[r];
        const Projection& there = there_[i] = projection(e, y_.data() + e.row);
        double error = 0.0, size = unit_;
        for (int k = 0; k < e.dim(); ++k) {
            const int r = e.row + k;
            e_[r] = there.P[k] - f[r];
            const double scaled = e_[r] * unit_force_[r];
            merit += scaled * scaled;
            error = std::max(error, std::abs(scaled));
            size = std::max(size, std::abs(f[r]) * unit_force_[r]);
        }
        if (!(error < HUGE_VAL)) worst = HUGE_VAL;
        else if (error > worst * size) worst = error / size;
    }
    return worst;
}

void BlockNewton::worst(const BlockProblem& p, const Island& island, const VecX& f, const VecX& w, int& element,
                        double& velocity) const {
    double largest = -1.0;
    for (int i : island.elements) {
        const BlockElement& e = p.elements[i];
        double y[3], error = 0.0, size = unit_, miss = 0.0;
        for (int k = 0; k < e.dim(); ++k) y[k] = f[e.row + k] - rho_[e.row + k] * w[e.row + k];
        const Projection there = projection(e, y);
        for (int k = 0; k < e.dim(); ++k) {
            const int r = e.row + k;
            const double distance = std::abs(there.P[k] - f[r]);
            error = std::max(error, distance * unit_force_[r]);
            size = std::max(size, std::abs(f[r]) * unit_force_[r]);
            miss = std::max(miss, distance / rho_[r]);
        }
        if (!(error > largest * size)) continue;
        largest = error / size;
        element = i;
        velocity = miss;
    }
}

// Compute G of all elements. Return true if the linear pieces differ from those of the last factor, or if `anew`.
bool BlockNewton::linearize(const BlockProblem& p, const Island& island, double d, bool anew, bool& symmetric) {
    bool changes = anew;
    symmetric = true;
    for (int i : island.elements) {
        const BlockElement& e = p.elements[i];
        const Projection& there = there_[i];
        changes |= there.piece != piece_[i] || (there.piece == Piece::slips && e.dim() > 1);
        symmetric &= there.piece != Piece::slips || !e.head() || e.cone.bound == 0.0;
        piece_[i] = there.piece;
    }
    if (!changes) return false;
    const double yielding = d + compliance_;
    for (int i : island.elements) {
        const BlockElement& e = p.elements[i];
        const int head = e.head(), n = e.dim();
        double* G = &G_[9 * i];
        std::fill(G, G + 9, 0.0);
        if (piece_[i] == Piece::open) continue;
        if (head) G[0] = rho_[e.row] / yielding;
        if (piece_[i] == Piece::sticks) {
            for (int k = head; k < n; ++k) G[k * n + k] = rho_[e.row + k] / yielding;
            continue;
        }
        const Projection& there = there_[i];
        const double turn = there.ratio / (1.0 - (1.0 - yielding) * there.ratio);
        for (int k = head; k < n; ++k) {
            if (head) G[k * n] = e.cone.bound * there.t[k] * rho_[e.row] / yielding;
            for (int l = head; l < n; ++l)
                G[k * n + l] = rho_[e.row + k] * turn * ((k == l ? 1.0 : 0.0) - there.t[k] * there.t[l]);
        }
    }
    return true;
}

// Compute z of all elements, and dx = J^T z.
void BlockNewton::local_step(const BlockProblem& p, const Island& island, double d, VecX& dx) {
    const double yielding = d + compliance_;
    for (int n : island.nodes) dx.segment(p.nodes[n].first, p.nodes[n].size).setZero();
    for (int i : island.elements) {
        const BlockElement& e = p.elements[i];
        const int head = e.head(), n = e.dim();
        const double* error = e_.data() + e.row;
        double* z = z_.data() + e.row;
        const bool sticks = piece_[i] == Piece::sticks, slips = piece_[i] == Piece::slips;
        if (head) z[0] = sticks || slips ? error[0] / yielding : error[0];
        for (int k = head; k < n; ++k) z[k] = sticks ? error[k] / yielding : error[k];
        if (slips) {
            const Projection& there = there_[i];
            double along = 0.0;
            for (int k = head; k < n; ++k) along += there.t[k] * error[k];
            const double pushed = head ? e.cone.bound * (1.0 - yielding) * z[0] : 0.0;
            for (int k = head; k < n; ++k)
                z[k] = there.t[k] * (along + pushed) +
                       (error[k] - along * there.t[k]) / (1.0 - (1.0 - yielding) * there.ratio);
        }
        p.push(e, z_, dx);
    }
}

// Compute the step df of the forces.
void BlockNewton::find_step(const BlockProblem& p, const Island& island, const BlockFactor& factor, double d) {
    local_step(p, island, d, dx_);
    factor.solve(dx_);
    p.respond(island.elements, dx_, dw_);
    for (int i : island.elements) {
        const BlockElement& e = p.elements[i];
        const int n = e.dim();
        const double* G = &G_[9 * i];
        for (int k = 0; k < n; ++k) {
            double force = z_[e.row + k];
            for (int l = 0; l < n; ++l) force -= G[k * n + l] * dw_[e.row + l];
            df_[e.row + k] = force;
        }
    }
}

// Compute the forces and the motion of the full step. The motion follows from the forces alone, without the rounding error
// of the steps so far.
void BlockNewton::try_step(const BlockProblem& p, const Island& island, const VecX& f) {
    for (int i : island.elements)
        for (int r = p.elements[i].row; r < p.elements[i].row + p.elements[i].dim(); ++r) f_full_[r] = f[r] + df_[r];
    move(p, island, f_full_, x_full_, w_full_);
}

// Find the longest of some steps that reduces the merit, the sum of squared errors, enough. Return false if none does.
bool BlockNewton::shorten(const BlockProblem& p, const Island& island, const VecX& f, const VecX& w, double bound,
                          int most_halvings, double& length, double& error, double& merit) {
    length = 1.0;
    error = evaluate(p, island, f_full_, w_full_, merit);
    for (int halving = 0;; ++halving) {
        if (merit <= (1.0 - parameters.decrease * length) * bound) return true;
        if (halving == most_halvings) break;
        length *= 0.5;
        for (int i : island.elements) {
            const BlockElement& e = p.elements[i];
            for (int r = e.row; r < e.row + e.dim(); ++r) {
                f_part_[r] = f[r] + length * df_[r];
                w_part_[r] = w[r] + length * (w_full_[r] - w[r]);
            }
        }
        error = evaluate(p, island, f_part_, w_part_, merit);
    }
    length = 1.0;
    return false;
}

// Take a step of a length, with its motion.
void BlockNewton::take(const BlockProblem& p, const Island& island, double length, VecX& f, VecX& x, VecX& w) {
    for (int i : island.elements) {
        const int row = p.elements[i].row, n = p.elements[i].dim();
        for (int r = row; r < row + n; ++r) f[r] = length == 1.0 ? f_full_[r] : f[r] + length * df_[r];
        if (length == 1.0) w.segment(row, n) = w_full_.segment(row, n);
    }
    if (length != 1.0) return move(p, island, f, x, w);
    for (int n : island.nodes)
        x.segment(p.nodes[n].first, p.nodes[n].size) = x_full_.segment(p.nodes[n].first, p.nodes[n].size);
}

void BlockNewton::begin(const BlockProblem& p, const Island& island, const VecX& free_w) {
    unit_ = 1.0;
    unit_ = speed(p, island, free_w, false);
}

double BlockNewton::speed(const BlockProblem& p, const Island& island, const VecX& w, bool of_rest) const {
    double largest = 0.0;
    for (int i : island.elements) {
        if (of_rest && !p.elements[i].rests) continue;
        for (int r = p.elements[i].row; r < p.elements[i].row + p.elements[i].dim(); ++r)
            largest = std::max(largest, root_rho_[r] * std::abs(w[r]));
    }
    return unit_ > 0.0 ? largest / unit_ : 0.0;
}

double BlockNewton::error(const BlockProblem& p, const Island& island, const VecX& f, const VecX& w) {
    double merit;
    compliance_ = 0.0;
    return evaluate(p, island, f, w, merit);
}

// Check if an element left the linear piece of the last factor.
bool BlockNewton::has_changed_piece(const Island& island) const {
    return std::any_of(island.elements.begin(), island.elements.end(), [&](int i) { return there_[i].piece != piece_[i]; });
}

double BlockNewton::solve_without_compliance(const BlockProblem& p, const Island& island, BlockFactor& factor, VecX& f,
                                             VecX& x, VecX& w) {
    keeps_factor_ = yielding_ > 0.0;
    const double error = solve(p, island, factor, Search::bold, 0.0, f, x, w);
    keeps_factor_ = false;
    return error;
}

namespace {

// Weight of the proximal term through the steps of one search.
class ProximalWeight {
public:
    // A factor of the equations exists for the weight `factored`, if that is positive.
    ProximalWeight(double weight, double factored) : weight_(weight), factored_(factored) {}

    static double of_error(double error) { return std::clamp(error, limits.min_proximal, limits.max_proximal); }
    void set(double weight) { weight_ = weight; }
    // Return the weight for which the next step has its factor, the present one if the weight has changed little.
    // `is_new`: whether this weight differs from that of the present factor.
    double choose_factored(bool& is_new) {
        is_new = !(weight_ >= limits.min_kept_ratio * factored_ && weight_ <= limits.max_kept_ratio * factored_);
        if (is_new) factored_ = weight_;
        return factored_;
    }
    bool may_grow() const {
        return refusals_ < limits.max_refusals && weight_ < limits.min_kept_ratio * limits.max_proximal;
    }
    // Grow after a refused step; after a refused first step the weight is that of the error.
    void grow(bool is_first, double error) {
        weight_ = is_first ? of_error(error) : std::min(limits.max_proximal, limits.proximal_growth * weight_);
        ++refusals_;
        factored_ = 0.0;
    }
    void forget_refusals() { refusals_ = 0; }
    // Shrink after a full step from the squared error `before` to `merit`.
    void shrink(double merit, double before, double error) {
        const double reduction = merit < limits.good_decrease * before ? limits.good_reduction : limits.reduction;
        weight_ = std::max({limits.min_proximal, weight_ * reduction,
                            std::min(limits.error_part * error, limits.max_proximal)});
    }

private:
    static constexpr const BlockNewtonParameters& limits = BlockNewton::parameters;
    double weight_, factored_;
    int refusals_ = 0;
};

}  // namespace

double BlockNewton::solve(const BlockProblem& p, const Island& island, BlockFactor& factor, Search search,
                          double compliance, VecX& f, VecX& x, VecX& w) {
    compliance_ = compliance;
    const bool bold = search == Search::bold;
    const auto each_row = [&](const auto& act) {
        for (int i : island.elements)
            for (int r = p.elements[i].row; r < p.elements[i].row + p.elements[i].dim(); ++r) act(r);
    };
    if (!keeps_factor_) yielding_ = 0.0;
    double merit, error = evaluate(p, island, f, w, merit), least = error;
    if (error <= parameters.tolerance) return error;
    keeps_factor_ = keeps_factor_ && !has_changed_piece(island);
    if (!keeps_factor_) {
        factor.analyse(p, island);
        for (int i : island.elements) piece_[i] = Piece::unknown;
    }
    each_row([&](int r) { f_best_[r] = f[r]; });
    ProximalWeight weight(keeps_factor_ ? yielding_ : bold ? parameters.min_proximal : ProximalWeight::of_error(error),
                          keeps_factor_ ? yielding_ : 0.0);
    double recent[4] = {merit, merit, merit, merit};
    int unguarded = 0, stagnant_steps = 0;
    for (int step = 0; step < parameters.max_steps && error > parameters.tolerance; ++step, ++steps_) {
        if (!bold) weight.set(ProximalWeight::of_error(error));
        bool is_new, symmetric = true;
        const double factored = weight.choose_factored(is_new);
        keeps_factor_ = keeps_factor_ && !has_changed_piece(island);
        if (!keeps_factor_ && linearize(p, island, factored, is_new, symmetric)) {
            ++factors_;
            yielding_ = factored + compliance_;
            if (!factor.factor(p, island, G_, symmetric)) break;
        }
        find_step(p, island, factor, factored);
        try_step(p, island, f);
        double length;
        const double before = error, merit_before = merit;
        const double bound = bold ? merit : std::max({recent[0], recent[1], recent[2], recent[3]});
        const int halvings = bold ? parameters.max_halvings : parameters.max_patient_halvings;
        const bool accepted = shorten(p, island, f, w, bound, halvings, length, error, merit);
        if (!accepted && bold && weight.may_grow()) {
            error = evaluate(p, island, f, w, merit);
            weight.grow(step == 0, error);
            continue;
        }
        if (!accepted) {
            if (++unguarded > parameters.max_unguarded_steps) {
                error = before;
                break;
            }
            weight.forget_refusals();
        }
        take(p, island, length, f, x, w);
        if (!accepted || (length != 1.0 && error <= parameters.stall_tolerance)) error = evaluate(p, island, f, w, merit);
        recent[step % 4] = merit;
        if (!(merit < HUGE_VAL)) break;
        if (accepted && length == 1.0) {
            weight.forget_refusals();
            keeps_factor_ = keeps_factor_ && merit < parameters.fast_decrease * merit_before;
            if (!keeps_factor_) weight.shrink(merit, merit_before, error);
        }
        if (error < least) {
            least = error;
            each_row([&](int r) { f_best_[r] = f[r]; });
        }
        if (least < parameters.stall_tolerance && error > parameters.stall_ratio * before && ++stagnant_steps > 1) break;
    }
    if (error > least || !(error < HUGE_VAL)) {
        each_row([&](int r) { f[r] = f_best_[r]; });
        move(p, island, f, x, w);
    }
    return least;
}

}  // namespace pn
