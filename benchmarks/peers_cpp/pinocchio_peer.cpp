// Pinocchio's own forward dynamics, called many times from C++ at one state: seconds per evaluation; and motions of trees
// by Boost.odeint on top of it.
#include <algorithm>
#include <chrono>
#include <stdexcept>
#include <vector>

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <boost/numeric/odeint.hpp>
#include <boost/python.hpp>
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/constrained-dynamics.hpp>
#include <pinocchio/multibody.hpp>

namespace nb = nanobind;
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

    // The motion of a tree whose coordinates are plain numbers, by the method of order 8 of Fehlberg; its steps.
    int integrate(Array q, Array v, double duration, double rtol, double atol) {
        namespace odeint = boost::numeric::odeint;
        using State = std::vector<double>;
        const int n = model_.nv;
        if (model_.nq != n || !models_.empty()) throw std::invalid_argument("expected a tree of plain coordinates");
        State y(2 * n);
        std::copy(q.data(), q.data() + n, y.begin());
        std::copy(v.data(), v.data() + n, y.begin() + n);
        const ConstView tau_view(tau_);
        const auto rate = [&](const State& at, State& to, double) {
            const ConstView q_view(Eigen::Map<const VectorX>(at.data(), n));
            const ConstView v_view(Eigen::Map<const VectorX>(at.data() + n, n));
            pinocchio::aba(model_, data_, q_view, v_view, tau_view, pinocchio::Convention::LOCAL);
            std::copy(at.begin() + n, at.end(), to.begin());
            Eigen::Map<VectorX>(to.data() + n, n) = data_.ddq;
        };
        auto stepper = odeint::make_controlled<odeint::runge_kutta_fehlberg78<State>>(atol, rtol);
        const size_t steps = odeint::integrate_adaptive(stepper, rate, y, 0.0, duration, first_step);
        std::copy(y.begin(), y.begin() + n, q.data());
        std::copy(y.begin() + n, y.end(), v.data());
        return static_cast<int>(steps);
    }

private:
    static constexpr double first_step = 1e-3;  // [s]
    const pinocchio::Model model_;
    pinocchio::Data data_;
    VectorX tau_;
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
        .def("integrate", &Peer::integrate, "q"_a, "v"_a, "duration"_a, "rtol"_a, "atol"_a);
}
