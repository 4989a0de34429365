// Rows of constraints, contacts and friction at a state, and the terms of the equation of motion, as arrays.
#include <numeric>

#include "constraints/row_length.hpp"
#include "dynamics/evaluation.hpp"
#include "python/runner.hpp"
#include "tree/mass_factor.hpp"

namespace pn {

void Runner::place_rows(const Array& q_in, const Array& v_in, double t) {
    set(q_in, v_in, {});
    kinematics(p->mechanism, w->now.terms, q, v);
    evaluate_rows(*p, *w, t, v);
    for (int i = 0; i < static_cast<int>(p->gaps.size()); ++i) evaluate_gap(*p, *w, t, v, i);
}

std::tuple<Numbers, Numbers, Numbers, Numbers> Runner::rows(const Array& q_in, const Array& v_in, double t) {
    place_rows(q_in, v_in, t);
    const Mechanism& m = p->mechanism;
    const int nv = m.nv;
    std::vector<double> A(static_cast<size_t>(p->user_rows) * nv, 0.0), b(p->user_rows), phi = b, rate = b;
    for (int i = 0; i < p->constraints; ++i) {
        Block all = p->blocks[i];
        all.kept.clear();
        for (int k = 0; k < all.total; ++k) all.kept.push_back(k);
        const RowValues& values = w->now.values[i];
        std::vector<double> local(all.support.size() * all.total);
        fill_A(all, m, w->now.terms, values, local.data());
        for (int k = 0; k < all.total; ++k) {
            const int row = all.user_row + k;
            for (size_t l = 0; l < all.support.size(); ++l)
                A[static_cast<size_t>(row) * nv + all.support[l]] = local[l * all.total + k];
            b[row] = -values.drift[k];
            phi[row] = values.residual[k];
            rate[row] = values.rate[k];
        }
    }
    return {to_numpy(std::move(A)), to_numpy(std::move(b)), to_numpy(std::move(phi)), to_numpy(std::move(rate))};
}

Numbers Runner::row_lengths(const Array& q_in, const Array& v_in, double t, bool own) {
    set(q_in, v_in, {});
    set_modes(*p, *w, std::vector<Mode>(p->frictions.size(), unloaded));  // no joint is locked
    configure(*p, *w, t, q, v);
    std::vector<double> lengths(p->user_rows);
    const auto find = [&](int i, double* length) {
        const Block& block = p->blocks[i];
        std::vector<int> rows(block.total);
        std::iota(rows.begin(), rows.end(), 0);
        evaluate_block(*p, *w, t, v, i);  // also for open contacts
        (own ? own_lengths : greatest_lengths)(p->mechanism, w->now.terms, block, rows, w->now.values[i], length);
    };
    for (int i = 0; i < p->constraints; ++i) find(i, lengths.data() + p->blocks[i].user_row);
    for (const Friction& f : p->frictions) {
        lengths.resize(lengths.size() + f.dim);
        find(f.block, lengths.data() + lengths.size() - f.dim);
    }
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
        std::vector<double> local(block.support.size() * f.dim);
        fill_A(block, p->mechanism, w->now.terms, w->now.values[f.block], local.data());
        for (int k = 0; k < f.dim; ++k) {
            rows.resize(rows.size() + nv, 0.0);
            for (size_t l = 0; l < block.support.size(); ++l)
                rows[rows.size() - nv + block.support[l]] = local[l * f.dim + k];
        }
    }
    return to_numpy(std::move(rows));
}

Numbers Runner::pressing_lines(const Array& q_in, const Array& v_in, double t) {
    place_rows(q_in, v_in, t);
    std::vector<double> lines;
    for (int block : framed_contacts(*p)) {
        const Wrench& unit = w->now.values[block].wrench[0];
        for (const Vec3& part : {unit.point, unit.force})
            for (int k = 0; k < 3; ++k) lines.push_back(part[k]);
    }
    return to_numpy(std::move(lines));
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

}  // namespace pn
