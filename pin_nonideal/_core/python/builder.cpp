#include "python/builder.hpp"

#include <algorithm>

#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "python/callbacks.hpp"
#include "tree/pinocchio_reader.hpp"

using namespace nanobind::literals;

namespace pn {

Builder::Builder(nb::object model, Provider terms) {
    program_->mechanism = read_mechanism(model_pointer(model.ptr()), terms);
}

Program& Builder::edit() {
    if (is_finished_) program_ = std::make_shared<Program>(*program_);
    is_finished_ = false;
    return *program_;
}

int Builder::add(const std::string& name, Kind kind, Role role) {
    Program& p = edit();
    const int index = static_cast<int>(p.blocks.size());
    p.blocks.emplace_back(name, std::move(kind));
    if (role == Role::direction) return index;
    p.blocks[index].user_row = p.user_rows;
    p.user_rows += p.blocks[index].total;
    p.constraints = p.first_gap = index + 1;
    return index;
}

void Builder::set_unilateral(double restitution) {
    Program& p = edit();
    p.gaps.push_back({p.constraints - 1, restitution, {}, -1});
    p.first_gap = p.gaps.front().block;
}

void Builder::order_contacts(const std::vector<int>& blocks, const std::vector<int>& pairs) {
    Program& p = edit();
    p.all_contacts = blocks;
    std::vector<int> pair_of(p.blocks.size(), -1);
    for (size_t i = 0; i < blocks.size(); ++i) pair_of[blocks[i]] = pairs.at(i);
    for (Gap& gap : p.gaps) gap.pair = pair_of[gap.block];
    int row = p.user_rows;
    for (int block : blocks) row = std::min(row, p.blocks[block].user_row);
    for (int block : blocks) {
        p.blocks[block].user_row = row;
        row += p.blocks[block].total;
    }
}

int Builder::add_law(const std::string& name) {
    edit().law_names.push_back(name);
    return static_cast<int>(program().law_names.size()) - 1;
}

std::shared_ptr<const Program> Builder::finish() {
    if (!is_finished_) program_->finish();
    is_finished_ = true;
    return program_;
}

namespace {

// User function of t, q, v and the reactions. The function returns the limits (forward, backward).
using UserLimit = Function<std::pair<double, double>(double, Numbers, Numbers, ReactionView)>;

// Bind friction elements, which act along their directions of slip.
void bind_friction(nb::class_<Builder>& builder) {
    builder
        .def("add_friction", [](Builder& b, int law, int block, const std::string& name, Friction::Load load,
                                Reaction reaction, int joint, int anchor, int row, const std::vector<double>& axis,
                                int axis_dof, double constant, double mu, double radius, double axial_radius,
                                double inverse_span, double static_ratio, double stribeck_velocity,
                                const UserLimit& user_limit) {
            Friction f;
            f.name = name;
            f.law = law;
            f.block = block;
            f.dim = b.program().blocks[block].total;
            f.load = load;
            f.reaction = reaction;
            f.joint = joint;
            f.anchor = anchor;
            f.anchor_row = row;
            f.axis = vec3(axis);
            f.axis_dof = axis_dof;
            f.constant = constant;
            f.mu = mu;
            f.radius = radius;
            f.axial_radius = axial_radius;
            f.inverse_span = inverse_span;
            f.static_ratio = static_ratio;
            f.stribeck_velocity = stribeck_velocity;
            if (user_limit) f.user_limit = limit_function(*user_limit);
            b.edit().frictions.push_back(std::move(f));
        }, "law"_a, "block"_a, nb::kw_only(), "name"_a, "load"_a = Friction::Load::none,
           "reaction"_a = Reaction::none, "joint"_a = -1, "anchor"_a = -1, "row"_a = 0,
           "axis"_a = std::vector<double>{0.0, 0.0, 1.0}, "axis_dof"_a = -1, "constant"_a = 0.0,
           "mu"_a = 0.0, "radius"_a = 0.0, "axial_radius"_a = 0.0, "inverse_span"_a = 0.0, "static_ratio"_a = 1.0,
           "stribeck_velocity"_a = 0.0, "user_limit"_a = nb::none());
}

void bind_laws(nb::class_<Builder>& builder) {
    builder
        .def("add_law", &Builder::add_law, "name"_a)
        .def("add_viscous", [](Builder& b, int law, double coefficient, int dof, int count, int block, int anchor) {
            b.edit().add(Viscous{law, dof, count, block, coefficient, anchor});
        }, "law"_a, "coefficient"_a, nb::kw_only(), "dof"_a = -1, "count"_a = 1, "block"_a = -1, "anchor"_a = -1)
        .def("add_drag", [](Builder& b, int law, const FrameTuple& frame, double coefficient, double exponent) {
            b.edit().add(Drag{law, frame_of(frame), coefficient, exponent});
        }, "law"_a, "frame"_a, "coefficient"_a, "exponent"_a)
        .def("add_sigmoid", [](Builder& b, int law, int dof, double phi1, double phi2, double phi3) {
            b.edit().add(Sigmoid{law, dof, phi1, phi2, phi3});
        }, "law"_a, "dof"_a, "phi1"_a, "phi2"_a, "phi3"_a)
        .def("add_lugre", [](Builder& b, int law, int dof, double stiffness, double damping, double viscous,
                             double coulomb, double stiction, double stribeck_velocity) {
            b.edit().add(LuGre{law, dof, stiffness, damping, viscous, coulomb, stiction, stribeck_velocity});
        }, "law"_a, "dof"_a, "stiffness"_a, "damping"_a, "viscous"_a, "coulomb"_a, "stiction"_a,
           "stribeck_velocity"_a)
        .def("add_user_law", [](Builder& b, int law, int states, Reaction reaction,
                                const nb::typed<nb::callable, nb::object(...)>& function) {
            UserLaw u;
            u.law = law;
            u.states = states;
            u.reaction = reaction;
            u.function = law_function(function, states, u.reaction != Reaction::none);
            b.edit().add(std::move(u));
        }, "law"_a, "states"_a, "reaction"_a, "function"_a);
}

using TorqueOfState = nb::typed<nb::callable, Numbers(double, Numbers, Numbers)>;

void bind_forces(nb::class_<Builder>& builder) {
    builder
        .def("add_spring_damper", [](Builder& b, const FrameTuple& f1, const FrameTuple& f2, double stiffness,
                                     double damping, double rest_length) {
            b.edit().forces.emplace_back(SpringDamper{frame_of(f1), frame_of(f2), stiffness, damping, rest_length});
        }, "frame1"_a, "frame2"_a, "stiffness"_a, "damping"_a, "rest_length"_a)
        .def("add_joint_spring", [](Builder& b, int joint, double stiffness, double rest, double damping) {
            b.edit().forces.emplace_back(JointSpring{joint, stiffness, rest, damping});
        }, "joint"_a, "stiffness"_a, "rest"_a, "damping"_a)
        .def("add_wrench", [](Builder& b, const FrameTuple& frame, const std::vector<double>& six) {
            FrameWrench wrench{frame_of(frame), {}, {}};
            std::copy(six.begin(), six.end(), wrench.value);
            b.edit().forces.emplace_back(std::move(wrench));
        }, "frame"_a, "value"_a)
        .def("add_wrench", [](Builder& b, const FrameTuple& frame,
                              const nb::typed<nb::callable, Numbers(double)>& function) {
            b.edit().forces.emplace_back(FrameWrench{frame_of(frame), wrench_function(function), {}});
        }, "frame"_a, "function"_a)
        .def("add_user_force", [](Builder& b, const TorqueOfState& f) {
            b.edit().forces.emplace_back(UserForce{user_function<OfState>(f)});
        }, "function"_a);
}

void bind_actuation(nb::class_<Builder>& builder) {
    builder
        .def("set_constant_torque", [](Builder& b, Array tau) { b.edit().actuation = ConstantTorque{map(tau)}; }, "tau"_a)
        .def("set_torque_function", [](Builder& b, const TorqueOfState& f) {
            b.edit().actuation = TorqueFunction{user_function<OfState>(f)};
        }, "function"_a)
        .def("set_sampled_torque", [](Builder& b, const TorqueOfState& f, double period) {
            b.edit().actuation = SampledTorque{user_function<OfState>(f), period};
        }, "function"_a, "period"_a)
        .def("set_hold_position", [](Builder& b, Array kp, Array kd, Array q) {
            b.edit().actuation = HoldPosition{map(kp), map(kd), map(q)};
        }, "kp"_a, "kd"_a, "q"_a)
        .def("set_torque_table", [](Builder& b, std::vector<double> times, Array2 values) {
            b.edit().actuation = TorqueTable{std::move(times), map(values).transpose()};
        }, "times"_a, "values"_a)
        .def("add_torque_table", [](Builder& b, std::vector<double> times, Array2 values) {
            b.edit().added_torque = TorqueTable{std::move(times), map(values).transpose()};
        }, "times"_a, "values"_a)
        .def("limit_effort", [](Builder& b, Array min_effort, Array max_effort) {
            b.edit().min_effort = map(min_effort);
            b.edit().max_effort = map(max_effort);
        }, "min_effort"_a, "max_effort"_a);
}

void bind_enums(nb::module_& m) {
    nb::enum_<Provider>(m, "Provider", "Provider of kinematics, M and bias forces.")
        .value("core", Provider::core)
        .value("pinocchio", Provider::pinocchio);
    using Load = Friction::Load;
    nb::enum_<Load>(m, "Load", "Load on which the friction limit of a bearing depends.")
        .value("none", Load::none)
        .value("revolute", Load::revolute)
        .value("prismatic", Load::prismatic)
        .value("spherical", Load::spherical)
        .value("planar", Load::planar)
        .value("multiplier", Load::multiplier)
        .value("user", Load::user);
    nb::enum_<Mode>(m, "Mode", nb::is_arithmetic(), "Mode of a friction element: slip in either direction, or stick.")
        .value("slip_minus", slip_minus)
        .value("sticking", sticking)
        .value("slip_plus", slip_plus)
        .value("unloaded", unloaded, "no friction: the contact is open, or the caller removes the friction");
    nb::enum_<DisplayKind>(m, "DisplayKind", "Display of a constraint in a replay.")
        .value("nothing", DisplayKind::nothing)
        .value("anchor", DisplayKind::anchor)
        .value("rod", DisplayKind::rod)
        .value("contact", DisplayKind::contact)
        .value("rolling", DisplayKind::rolling)
        .value("edge", DisplayKind::edge)
        .value("drive", DisplayKind::drive)
        .value("gear", DisplayKind::gear);
    nb::enum_<ImpactLaw>(m, "ImpactLaw", "Definition of restitution in an impact.")
        .value("newton", ImpactLaw::newton, "opening rate of a gap over its closing rate")
        .value("poisson", ImpactLaw::poisson, "impulse of expansion over impulse of compression");
    nb::enum_<Reaction>(m, "Reaction", "Motion whose reactions a law reads.")
        .value("none", Reaction::none)
        .value("ideal", Reaction::ideal)
        .value("total", Reaction::total);
}

}  // namespace

nb::class_<Builder> bind_builder(nb::module_& m) {
    bind_enums(m);
    nb::class_<Builder> builder(m, "Builder");
    builder.def(nb::init<nb::object, Provider>(), "model"_a, "terms"_a = Provider::core)
        .def("select_rows", [](Builder& b, int block, std::vector<int> rows) {
            b.edit().blocks[block].kept = std::move(rows);
        }, "block"_a, "rows"_a)
        .def("add_copy", [](Builder& b, int row, int first, double factor) {
            b.edit().copies.push_back({row, first, factor});
        }, "row"_a, "first"_a, "factor"_a)
        .def("add_breaks", [](Builder& b, const std::vector<double>& times) {
            std::vector<double>& breaks = b.edit().breaks;
            breaks.insert(breaks.end(), times.begin(), times.end());
        }, "times"_a)
        .def("set_unilateral", &Builder::set_unilateral, "restitution"_a)
        .def("set_impact", [](Builder& b, ImpactLaw law) { b.edit().impact_law = law; }, "law"_a)
        .def("order_contacts", &Builder::order_contacts, "blocks"_a, "pairs"_a)
        .def("finish", &Builder::finish);
    bind_friction(builder);
    bind_laws(builder);
    bind_forces(builder);
    bind_actuation(builder);
    return builder;
}

}  // namespace pn
