#include "constraints/row_length.hpp"

#include <algorithm>
#include <cmath>

#include "constraints/rank_parameters.hpp"
#include "tree/mass_factor.hpp"

namespace pn {

namespace {

class Lengths {
public:
    Lengths(const Mechanism& m, Terms& terms, const Block& block) : m_(m), terms_(terms), block_(block), x_(m.nv) {
        if (block.is_deep()) body_.resize(m.joints.size());
        double mass = 0.0;
        for (const Joint& joint : m.joints) mass += joint.mass;
        if (mass > 0.0) least_ = rank_parameters.min_length_part * rank_parameters.min_length_part / mass;
    }

    // Return the squared length of the row of one unit wrench.
    double square(const Wrench& w) {
        x_.setZero();
        for (const DofSupport::Entry& e : block_.entries()) {
            if (m_.is_deep[e.dof]) continue;
            const Body& body = terms_.body[m_.dof_joint[e.dof]];
            x_[e.dof] = e.sign * dot(terms_.J[e.dof], {w.force, w.couple + (w.point - body.ref).cross(w.force)});
        }
        if (block_.is_deep()) {
            std::fill(body_.begin(), body_.end(), Force{});
            add_wrench(block_, terms_, w, 1.0, body_);
        }
        solve_R(m_, terms_, x_, block_.is_deep() ? body_.data() : nullptr);
        return x_.squaredNorm();
    }

    double of_forces(const Vec3& point) {
        return std::max(least_, square(force_at(point, Vec3::UnitX())) + square(force_at(point, Vec3::UnitY())) +
                                    square(force_at(point, Vec3::UnitZ())));
    }

    double of_couples(const Vec3& point) {
        return square(couple_at(point, Vec3::UnitX())) + square(couple_at(point, Vec3::UnitY())) +
               square(couple_at(point, Vec3::UnitZ()));
    }

    double of_coordinates(const RowValues& values, int row) {
        for (int dof = 0; dof < m_.nv; ++dof) x_[dof] = values.A(row, dof);
        solve_R(m_, terms_, x_);
        return x_.squaredNorm();
    }

private:
    const Mechanism& m_;
    Terms& terms_;
    const Block& block_;
    VecX x_;
    std::vector<Force> body_;
    double least_ = 0.0;
};

bool same_point(const Vec3& a, const Vec3& b) { return (a - b).squaredNorm() == 0.0; }

}  // namespace

void greatest_lengths(const Mechanism& m, Terms& terms, const Block& block, const std::vector<int>& rows,
                      const RowValues& values, double* length) {
    Lengths lengths(m, terms, block);
    double forces = -1.0, couples = -1.0;
    for (size_t k = 0; k < rows.size(); ++k) {
        const int row = rows[k];
        if (!values.geometric) {
            length[k] = std::sqrt(lengths.of_coordinates(values, row));
            continue;
        }
        const Wrench& w = values.wrench[row];
        if (k > 0 && !same_point(w.point, values.wrench[rows[k - 1]].point)) forces = -1.0;
        const double force = w.force.squaredNorm(), couple = w.couple.squaredNorm();
        if (force > 0.0 && forces < 0.0) forces = lengths.of_forces(w.point);
        if (couple > 0.0 && couples < 0.0) couples = lengths.of_couples(w.point);
        length[k] = std::sqrt((force > 0.0 ? force * forces : 0.0) + (couple > 0.0 ? couple * couples : 0.0));
    }
    if (values.geometric || rows.empty()) return;
    const double min_length = rank_parameters.min_function_length_part * *std::max_element(length, length + rows.size());
    std::transform(length, length + rows.size(), length, [&](double value) { return std::max(value, min_length); });
}

void own_lengths(const Mechanism& m, Terms& terms, const Block& block, const std::vector<int>& rows,
                 const RowValues& values, double* length) {
    Lengths lengths(m, terms, block);
    for (size_t k = 0; k < rows.size(); ++k) {
        const int row = rows[k];
        length[k] =
            std::sqrt(values.geometric ? lengths.square(values.wrench[row]) : lengths.of_coordinates(values, row));
    }
}

}  // namespace pn
