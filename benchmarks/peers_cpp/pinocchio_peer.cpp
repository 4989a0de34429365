// Pinocchio's own forward dynamics, called many times from C++ at one state: seconds per evaluation; and motions by
// Boost.odeint on top of it.
#include <algorithm>
#include <chrono>
#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>

#include <boost/numeric/odeint.hpp>
#include <boost/python.hpp>
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/constrained-dynamics.hpp>
#include <pinocchio/multibody.hpp>

namespace nb = nanobind;
namespace odeint = boost::numeric::odeint;
using namespace nb::literals;

namespace {

using Array = nb::ndarray<double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using VectorX = Eigen::VectorXd;
using ConstView = Eigen::Ref<const VectorX>;
using ConstraintModel = pinocchio::RigidConstraintModel;
using ConstraintData = pinocchio::RigidConstraintData;

template <class T>
const T& extract(nb::handle object, const char* what) {
    boost::python::extract<const T&> held(object.ptr());
    if (!held.check()) throw std::invalid_argument(what);
    return held();
}

VectorX copy(const Array& a) { return Eigen::Map<const VectorX>(a.data(), static_cast<Eigen::Index>(a.shape(0))); }

template <class Function>
double seconds_per_call(int count, const Function& call) {
    const auto begin = std::chrono::steady_clock::now();
    for (int i = 0; i < count; ++i) call();
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() / count;
}

class Peer {
public:
    Peer(nb::handle model, nb::list constraints, double mu, int iterations)
        : model_(extract<pinocchio::Model>(model, "expected a pinocchio.Model")),
          data_(model_), tau_(VectorX::Zero(model_.nv)), settings_(1e-14, mu, iterations) {
        for (nb::handle c : constraints)
            models_.push_back(extract<ConstraintModel>(c, "expected pinocchio.RigidConstraintModel"));
        for (const ConstraintModel& c : models_) datas_.emplace_back(c);
        if (!models_.empty()) pinocchio::initConstraintDynamics(model_, data_, models_, datas_);
    }

    double time_aba(const Array& q_in, const Array& v_in, int count, bool world) {
        const VectorX q = copy(q_in), v = copy(v_in);
        const ConstView q_view(q), v_view(v), tau_view(tau_);
        const auto convention = world ? pinocchio::Convention::WORLD : pinocchio::Convention::LOCAL;
        return seconds_per_call(count, [&] { pinocchio::aba(model_, data_, q_view, v_view, tau_view, convention); });
    }

    double time_constraint_dynamics(const Array& q_in, const Array& v_in, int count) {
        const VectorX q = copy(q_in), v = copy(v_in);
        return seconds_per_call(count, [&] {
            pinocchio::constraintDynamics(model_, data_, q, v, tau_, models_, datas_, settings_);
        });
    }

    void acceleration(const Array& q_in, const Array& v_in, Array out) {
        const VectorX q = copy(q_in), v = copy(v_in);
        if (models_.empty()) {
            const ConstView q_view(q), v_view(v), tau_view(tau_);
            pinocchio::aba(model_, data_, q_view, v_view, tau_view, pinocchio::Convention::WORLD);
        } else {
            pinocchio::constraintDynamics(model_, data_, q, v, tau_, models_, datas_, settings_);
        }
        Eigen::Map<VectorX>(out.data(), model_.nv) = data_.ddq;
    }

    // The motion of a mechanism whose coordinates are plain numbers, under constant torques, by an adaptive method of
    // Boost.odeint: configurations at the times, row by row, into q_out, the velocity at the last into v_out; returns the
    // number of evaluations, or -1 where it takes more than `most`.
    long integrate(const Array& q, const Array& v, const Array& tau, const Array& times, const std::string& method,
                   double rtol, double atol, long most, Array q_out, Array v_out) {
        if (model_.nq != model_.nv) throw std::invalid_argument("expected plain coordinates");
        tau_ = copy(tau);
        State y(2 * model_.nv);
        std::copy_n(q.data(), model_.nv, y.begin());
        std::copy_n(v.data(), model_.nv, y.begin() + model_.nv);
        try {
            if (method == "dopri5")
                return carry(odeint::make_controlled<odeint::runge_kutta_dopri5<State>>(atol, rtol), y, times, most, q_out,
                             v_out);
            if (method == "fehlberg78")
                return carry(odeint::make_controlled<odeint::runge_kutta_fehlberg78<State>>(atol, rtol), y, times, most,
                             q_out, v_out);
            if (method == "bulirsch_stoer")
                return carry(odeint::bulirsch_stoer<State>(atol, rtol), y, times, most, q_out, v_out);
        } catch (const TooLong&) {
            return -1;
        }
        throw std::invalid_argument("unknown method");
    }

private:
    using State = std::vector<double>;
    struct TooLong {};

    void rate(const State& at, State& to) {
        const int n = model_.nv;
        const Eigen::Map<const VectorX> q(at.data(), n), v(at.data() + n, n);
        if (models_.empty()) {
            const ConstView q_view(q), v_view(v), tau_view(tau_);
            pinocchio::aba(model_, data_, q_view, v_view, tau_view, pinocchio::Convention::LOCAL);
        } else {
            q_ = q, v_ = v;
            pinocchio::constraintDynamics(model_, data_, q_, v_, tau_, models_, datas_, settings_);
        }
        std::copy(at.begin() + n, at.end(), to.begin());
        Eigen::Map<VectorX>(to.data() + n, n) = data_.ddq;
    }

    template <class Stepper>
    long carry(Stepper stepper, State& y, const Array& times, long most, Array& q_out, Array& v_out) {
        const int n = model_.nv;
        long count = 0;
        const auto derivative = [&](const State& at, State& to, double) {
            if (++count > most) throw TooLong{};
            rate(at, to);
        };
        double t = 0.0, step = first_step;
        for (size_t k = 0; k < times.shape(0); ++k) {
            odeint::integrate_adaptive(std::ref(stepper), derivative, y, t, times.data()[k], step);
            t = times.data()[k];
            std::copy_n(y.begin(), n, q_out.data() + k * n);
        }
        std::copy_n(y.begin() + n, n, v_out.data());
        return count;
    }

    static constexpr double first_step = 1e-3;  // [s]
    const pinocchio::Model model_;
    pinocchio::Data data_;
    VectorX tau_, q_, v_;
    pinocchio::ProximalSettings settings_;
    std::vector<ConstraintModel> models_;
    std::vector<ConstraintData> datas_;
};

}  // namespace

NB_MODULE(PEER_NAME, m) {
    nb::class_<Peer>(m, "Peer")
        .def(nb::init<nb::handle, nb::list, double, int>(), "model"_a, "constraints"_a, "mu"_a, "iterations"_a)
        .def("time_aba", &Peer::time_aba, "q"_a, "v"_a, "count"_a, "world"_a)
        .def("time_constraint_dynamics", &Peer::time_constraint_dynamics, "q"_a, "v"_a, "count"_a)
        .def("acceleration", &Peer::acceleration, "q"_a, "v"_a, "out"_a)
        .def("integrate", &Peer::integrate, "q"_a, "v"_a, "tau"_a, "times"_a, "method"_a, "rtol"_a, "atol"_a, "most"_a,
             "q_out"_a, "v_out"_a);
}
