#include "python/callbacks.hpp"

#include "dynamics/reactions.hpp"

#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

using namespace nanobind::literals;

namespace pn {

Numbers ReactionView::lam() const {
    return to_numpy(p->user_multipliers(reactions(*p, *w).lam));
}

static Numbers six(const Force& f, const Mat3& R) {
    VecX out(6);
    out << transpose_times(R, f.lin).eigen(), transpose_times(R, f.ang).eigen();
    return to_numpy(out);
}

Numbers ReactionView::of_joint(int joint) const { return six(joint_wrench(*p, *w, joint), w->now.terms.body[joint].R); }

Numbers ReactionView::of_block(int block) const {
    const Frame& f = *frames(p->blocks[block].kind).second;
    return six(anchor_wrench(*p, *w, block), w->now.terms.body[f.joint].R * f.R);
}

TimeFunction time_function(const nb::object& f) {
    if (nb::isinstance<nb::tuple>(f)) {
        const nb::tuple parts = nb::cast<nb::tuple>(f);
        const std::string kind = nb::cast<std::string>(parts[0]);
        const auto numbers = nb::cast<std::vector<double>>(parts[1]);
        if (kind == "polynomial") return Polynomial{numbers};
        if (kind == "sinusoid") return Sinusoid{numbers[0], numbers[1], numbers[2], numbers[3]};
        if (kind == "spline") return Spline{numbers, nb::cast<std::vector<double>>(parts[2])};
        throw std::invalid_argument("unknown function of time " + kind);
    }
    return std::function<Jet(double)>([f](double t) {
        nb::gil_scoped_acquire gil;
        const auto [x, dx, ddx] = nb::cast<std::tuple<double, double, double>>(f(t));
        return Jet{x, dx, ddx};
    });
}

static void read_head(const nb::object& from, VecX& to) {
    const Array value = nb::cast<Array>(from);
    to.head(value.shape(0)) = map(value);
}

template <>
std::function<OfState> user_function(nb::callable f) {
    return [f, q_in = HandedArray(), v_in = HandedArray()](double t, const VecX& q, const VecX& v, VecX& out) mutable {
        nb::gil_scoped_acquire gil;
        read_head(f(t, q_in(q), v_in(v)), out);
    };
}

template <>
std::function<OfPosition> user_function(nb::callable f) {
    return [f, q_in = HandedArray()](double t, const VecX& q, VecX& out) mutable {
        nb::gil_scoped_acquire gil;
        read_head(f(t, q_in(q)), out);
    };
}

template <>
std::function<Rows> user_function(nb::callable f) {
    return [f, q_in = HandedArray(), v_in = HandedArray()](double t, const VecX& q, const VecX& v, MatX& A,
                                                           VecX& b) mutable {
        nb::gil_scoped_acquire gil;
        const auto [A_out, b_out] = nb::cast<std::pair<Array2, Array>>(f(t, q_in(q), v_in(v)));
        A = map(A_out);
        b.head(A.rows()) = map(b_out);
    };
}

std::function<void(double, double*)> wrench_function(nb::object f) {
    return [f](double t, double* out) {
        nb::gil_scoped_acquire gil;
        const Array value = nb::cast<Array>(f(t));
        std::copy(value.data(), value.data() + 6, out);
    };
}

decltype(Friction::user_limit) limit_function(nb::object f) {
    return [f, q_in = HandedArray(), v_in = HandedArray()](const Program& p, double t, const VecX& q, const VecX& v,
                                                           Workspace& w) mutable {
        nb::gil_scoped_acquire gil;
        const auto [forward, backward] =
            nb::cast<std::pair<double, double>>(f(t, q_in(q), v_in(v), ReactionView{&p, &w}));
        return SlipLimits(forward, backward);
    };
}

decltype(UserLaw::function) law_function(nb::object f, int states, bool reads_reactions) {
    return [f, states, reads_reactions, q_in = HandedArray(), v_in = HandedArray(), z_in = HandedArray()](
               const Program& p, double t, const VecX& q, const VecX& v, Workspace& w, VecX& C, const double* z,
               double* dz) mutable {
        nb::gil_scoped_acquire gil;
        nb::object view = reads_reactions ? nb::cast(ReactionView{&p, &w}) : nb::none();
        if (states == 0) {
            read_into(f(t, q_in(q), v_in(v), view), C);
            return;
        }
        const auto [force, rate] = nb::cast<std::pair<Array, Array>>(
            f(t, q_in(q), v_in(v), view, z_in(z, states)));
        C = map(force);
        std::copy(rate.data(), rate.data() + states, dz);
    };
}

void bind_reactions(nb::module_& m) {
    nb::class_<ReactionView>(m, "ReactionView")
        .def_prop_ro("lam", &ReactionView::lam, nb::rv_policy::automatic)
        .def("of_joint", &ReactionView::of_joint, "joint"_a)
        .def("of_block", &ReactionView::of_block, "block"_a);
}

}  // namespace pn
