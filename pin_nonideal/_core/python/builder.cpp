// Builds a Program from plain numbers and functions: friction, other laws, forces, torques.
#include "python/callbacks.hpp"
#include "tree/model_extraction.hpp"

#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

using namespace nanobind::literals;

namespace pn {

Builder::Builder(nb::object model, bool pinocchio_terms) {
    p->mechanism = read_mechanism(model_pointer(model.ptr()), pinocchio_terms ? Provider::pinocchio : Provider::core);
}

int Builder::add(const std::string& name, Kind kind, bool constraint, int user_size) {
    Block block;
    block.name = name;
    block.total = row_count(kind, user_size);
    if (const Frame* f = frame1(kind)) block.joint1 = f->joint;
    if (const Frame* f = frame2(kind)) block.joint2 = f->joint;
    block.kind = std::move(kind);
    for (int k = 0; k < block.total; ++k) block.kept.push_back(k);
    if (constraint) {
        block.user_row = p->user_rows;
        p->user_rows += block.total;
        p->constraints = static_cast<int>(p->blocks.size()) + 1;
    }
    p->blocks.push_back(std::move(block));
    return static_cast<int>(p->blocks.size()) - 1;
}

int Builder::add_law(const std::string& name) {
    p->law_names.push_back(name);
    return static_cast<int>(p->law_names.size()) - 1;
}

namespace {

Reaction reaction_named(const std::string& name) {
    return name == "total" ? Reaction::total : name == "ideal" ? Reaction::ideal : Reaction::none;
}

// Frictional elements, which act along their directions of slip.
void bind_friction(nb::class_<Builder>& builder) {
    builder
        .def("add_friction", [](Builder& b, const std::string& name, int law, int block, const std::string& load,
                                const std::string& reaction, int joint, int anchor, const std::vector<double>& axis,
                                const nb::dict& x, nb::object user_limit) {
            Friction f;
            f.law = law;
            f.block = block;
            f.dim = b.p->blocks[block].total;
            using L = Friction::Load;
            f.load = load == "revolute" ? L::revolute : load == "prismatic" ? L::prismatic
                     : load == "spherical" ? L::spherical : load == "contact" ? L::contact
                     : load == "user" ? L::user : L::none;
            f.reaction = reaction_named(reaction);
            f.joint = joint;
            f.anchor = anchor;
            f.axis = vec3(axis);
            f.constant = nb::cast<double>(x["constant"]);
            f.mu = nb::cast<double>(x["mu"]);
            f.radius = nb::cast<double>(x["radius"]);
            f.axial_radius = nb::cast<double>(x["axial_radius"]);
            f.inverse_span = nb::cast<double>(x["inverse_span"]);
            f.static_ratio = nb::cast<double>(x["static_ratio"]);
            f.stribeck_velocity = nb::cast<double>(x["stribeck_velocity"]);
            if (!user_limit.is_none()) f.user_limit = limit_function(b.p.get(), user_limit);
            b.p->frictions.push_back(std::move(f));
            return static_cast<int>(b.p->frictions.size()) - 1;
        }, "name"_a, "law"_a, "block"_a, "load"_a, "reaction"_a, "joint"_a, "anchor"_a, "axis"_a, "numbers"_a,
           "user_limit"_a.none());
}

void bind_laws(nb::class_<Builder>& builder) {
    builder
        .def("add_viscous", [](Builder& b, int law, int dof, int count, int block, double coefficient) {
            b.p->laws.push_back(Viscous{law, dof, count, block, coefficient});
        })
        .def("add_drag", [](Builder& b, int law, const FrameTuple& frame, double coefficient, double exponent) {
            b.p->laws.push_back(Drag{law, frame_of(frame), coefficient, exponent, {}});
        })
        .def("add_sigmoid", [](Builder& b, int law, int dof, double phi1, double phi2, double phi3) {
            b.p->laws.push_back(Sigmoid{law, dof, phi1, phi2, phi3});
        })
        .def("add_bristle", [](Builder& b, int law, int dof, double sigma0, double sigma1, double sigma2,
                               double coulomb, double stiction, double stribeck_velocity) {
            b.p->laws.push_back(LuGre{law, dof, b.p->states, sigma0, sigma1, sigma2, coulomb, stiction,
                                      stribeck_velocity});
            ++b.p->states;
        })
        .def("add_user_law", [](Builder& b, int law, int states, const std::string& reaction, nb::object function) {
            UserLaw u;
            u.law = law;
            u.index = b.p->user_laws++;
            u.state = b.p->states;
            u.states = states;
            b.p->states += states;
            u.reaction = reaction_named(reaction);
            u.function = law_function(b.p.get(), function, states, u.reaction != Reaction::none);
            b.p->laws.push_back(std::move(u));
        });
}

void bind_forces(nb::class_<Builder>& builder) {
    builder
        .def("add_spring_damper", [](Builder& b, const FrameTuple& f1, const FrameTuple& f2, double stiffness,
                                     double damping, double rest_length) {
            b.p->forces.emplace_back(SpringDamper{frame_of(f1), frame_of(f2), stiffness, damping, rest_length});
        })
        .def("add_joint_spring", [](Builder& b, int joint, double stiffness, double rest, double damping) {
            b.p->forces.emplace_back(JointSpring{joint, stiffness, rest, damping});
        })
        .def("add_wrench", [](Builder& b, const FrameTuple& frame, const std::vector<double>& six,
                              nb::object function) {
            FrameWrench wrench{frame_of(frame), {}, {}};
            std::copy(six.begin(), six.end(), wrench.value);
            if (!function.is_none()) wrench.function = wrench_function(function);
            b.p->forces.emplace_back(std::move(wrench));
        }, "frame"_a, "value"_a, "function"_a.none())
        .def("add_user_force", [](Builder& b, nb::object f) {
            b.p->forces.emplace_back(UserForce{torque_function(f)});
        });
}

void bind_actuation(nb::class_<Builder>& builder) {
    builder
        .def("set_constant_torque", [](Builder& b, Array tau) { b.p->actuation = ConstantTorque{map(tau)}; })
        .def("set_torque_function", [](Builder& b, nb::object f) {
            b.p->actuation = TorqueFunction{torque_function(f)};
        })
        .def("set_sampled_torque", [](Builder& b, nb::object f, double period) {
            b.p->actuation = SampledTorque{torque_function(f), period};
        })
        .def("set_hold_position", [](Builder& b, Array kp, Array kd, Array q) {
            b.p->actuation = HoldPosition{map(kp), map(kd), map(q)};
        })
        .def("set_torque_table", [](Builder& b, std::vector<double> times, Array2 values) {
            b.p->actuation = TorqueTable{std::move(times), map(values).transpose()};
        });
}

}  // namespace

void bind_builder(nb::module_& m) {
    nb::class_<Builder> builder(m, "Builder");
    builder.def(nb::init<nb::object, bool>(), "model"_a, "pinocchio_terms"_a = false)
        .def("add_law", &Builder::add_law)
        .def("keep_rows", [](Builder& b, int block, std::vector<int> rows) {
            b.p->blocks[block].kept = std::move(rows);
        })
        .def("finish", [](Builder& b) { b.p->finish(); })
        .def_prop_ro("states", [](Builder& b) { return b.p->states; })
        .def("runner", [](Builder& b) { return new Runner(b.p); }, nb::rv_policy::take_ownership);
    bind_constraints(builder);
    bind_slip_directions(builder);
    bind_friction(builder);
    bind_laws(builder);
    bind_forces(builder);
    bind_actuation(builder);
}

}  // namespace pn
