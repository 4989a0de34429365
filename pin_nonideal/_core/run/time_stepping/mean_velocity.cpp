#include "run/time_stepping/mean_velocity.hpp"

#include <algorithm>
#include <cmath>

#include "contact/impact.hpp"

namespace pn {

void MeanVelocity::FreeFlyer::turn_axes(VecX& v, const Eigen::Vector3d& angle) const {
    const double size = angle.norm();
    if (size == 0.0) return;
    const Eigen::Vector3d about_com = v.segment<3>(dof + 3).cross(com);
    v.segment<3>(dof) = Eigen::AngleAxisd(-size, angle / size) * (v.segment<3>(dof) + about_com) - about_com;
}

std::vector<MeanVelocity::FreeFlyer> MeanVelocity::flyers(const Program& p) {
    std::vector<FreeFlyer> out;
    for (const Joint& joint : p.mechanism.joints)
        if (joint.kind == JointKind::free_flyer) out.push_back({joint.iv, joint.com.eigen()});
    return out;
}

MeanVelocity::MeanVelocity(const Program& p)
    : flyers_(flyers(p)), unit_(p.mechanism.unit), turning_(VecX::Zero(p.mechanism.nv)) {}

void MeanVelocity::begin(double h, const VecX& v0, const VelocityRates& last) {
    h_ = h;
    start_ = v0;
    for (const FreeFlyer& flyer : flyers_) flyer.turn_axes(start_, 0.5 * h * v0.segment<3>(flyer.dof + 3));
    value_ = start_;
    predict(last);
    first_ = value_;
    restart();
}

void MeanVelocity::restart() {
    value_ = first_;
    moves_ = 0;
    measure();
}

// Predict the mean velocity. Dofs at rest stay at rest.
void MeanVelocity::predict(const VelocityRates& last) {
    is_predicted_ = false;
    if (last.count < 2) return;
    const auto& [a, b, c] = last.rate;
    const double none = size(a), constant = size(a - b), linear = last.count > 2 ? size(a - 2.0 * b + c) : HUGE_VAL;
    if (!(std::min(constant, linear) < parameters.max_unpredicted * none)) return;
    is_predicted_ = true;
    for (int k = 0; k < start_.size(); ++k)
        if (start_[k] != 0.0) value_[k] += 0.5 * h_ * (linear < constant ? 2.0 * a[k] - b[k] : a[k]);
}

void MeanVelocity::keep_rate(VelocityRates& last) const {
    for (int k = VelocityRates::most - 1; k > 0; --k) last.rate[k].swap(last.rate[k - 1]);
    last.rate[0] = (end_ - start_) / h_;
    last.count = std::min(last.count + 1, VelocityRates::most);
}

void MeanVelocity::measure() {
    for (const FreeFlyer& flyer : flyers_) {
        const Eigen::Vector3d v = value_.segment<3>(flyer.dof), omega = value_.segment<3>(flyer.dof + 3);
        turning_.segment<3>(flyer.dof) = omega.cross(v + omega.cross(flyer.com));
    }
    start_difference_ = start_ - value_ + 0.5 * h_ * turning_;
}

void MeanVelocity::end(const VecX& a, VecX& v1) {
    end_ = start_ + h_ * (a + turning_);
    v1 = end_;
    for (const FreeFlyer& flyer : flyers_) flyer.turn_axes(v1, 0.5 * h_ * end_.segment<3>(flyer.dof + 3));
}

bool MeanVelocity::move(bool touches) {
    next_ = 0.5 * (start_ + end_);
    const double tolerance = touches ? parameters.contact_tolerance : parameters.configuration_tolerance;
    const double allowed = moves_ == 0 && !is_predicted_ ? parameters.configuration_rounding : tolerance;
    if (moves_ == parameters.max_sweeps || h_ * size(next_ - value_) <= allowed) return false;
    value_ = next_;
    ++moves_;
    measure();
    return true;
}

void MeanVelocity::start_rates(const Program& p, Workspace& w, int i) const {
    const Block& block = p.blocks[i];
    const RowValues& values = w.now.values[i];
    const bool differs = moves_ > 0 || is_predicted_ || !flyers_.empty();
    if (differs) multiply(block, w.now.A, start_difference_, w.scratch.r);
    for (size_t k = 0; k < block.kept.size(); ++k) {
        double& rate = w.scratch.r[block.row + k];
        rate = values.rate[block.kept[k]] + (differs ? rate : 0.0);
    }
}

bool MeanVelocity::starts_at_rest(const Program& p, Workspace& w, const Friction& friction) const {
    const Block& block = p.blocks[friction.block];
    start_rates(p, w, friction.block);
    return w.scratch.r.segment(block.row, block.kept.size()).norm() <= rest_rate(start_);
}

double MeanVelocity::held_slip(const Program& p, const VecX& a) const {
    return parameters.held_rounding *
           (a.cwiseAbs().maxCoeff() + p.mechanism.gravity.norm() + start_.cwiseAbs().maxCoeff() / h_);
}

void MeanVelocity::meet_at_end(const Program& p, Workspace& w, VecX& b) const {
    for (int i = 0; i < p.first_gap; ++i) {
        const Block& block = p.blocks[i];
        if (block.kept.empty()) continue;
        start_rates(p, w, i);
        for (size_t k = 0; k < block.kept.size(); ++k)
            b[block.row + k] = 0.5 * b[block.row + k] - w.scratch.r[block.row + k] / h_;
    }
}

}  // namespace pn
