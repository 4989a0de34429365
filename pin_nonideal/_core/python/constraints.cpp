// Constraints and directions of friction from plain numbers and functions, one entry a kind; and what each says of
// itself.
#include "python/callbacks.hpp"

#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

using namespace nanobind::literals;

namespace pn {

int Builder::add_direction(const std::string& name, Kind kind) {
    p->blocks.emplace_back(name, std::move(kind));
    return static_cast<int>(p->blocks.size()) - 1;
}

int Builder::add_constraint(const std::string& name, Kind kind) {
    const int index = add_direction(name, std::move(kind));
    p->blocks[index].user_row = p->user_rows;
    p->user_rows += p->blocks[index].total;
    p->constraints = index + 1;
    return index;
}

std::vector<ConstraintRows> constraint_rows(const Program& p) {
    std::vector<ConstraintRows> out;
    for (int i = 0; i < p.constraints; ++i) {
        const Block& block = p.blocks[i];
        ConstraintRows rows{block.name, block.user_row, block.total, {}, moves_in_time(block.kind), shown(block.kind)};
        for (int k = 0; k < block.total; ++k) rows.holonomic.push_back(is_holonomic(block.kind, k));
        out.push_back(std::move(rows));
    }
    return out;
}

namespace {

using Text = const std::string&;
using Placed = const FrameTuple&;
using Three = const std::vector<double>&;

void bind_between_bodies(nb::class_<Builder>& builder) {
    builder
        .def("add_point", [](Builder& b, Text name, Placed frame1, Placed frame2, std::vector<int> axes) {
            return b.add_constraint(name, PointRows{frame_of(frame1), frame_of(frame2), std::move(axes)});
        }, "name"_a, "frame1"_a, "frame2"_a, "axes"_a)
        .def("add_contact", [](Builder& b, Text name, Placed frame, Placed plane, Three normal, double radius) {
            const int block = b.add_constraint(
                name, ContactRow{frame_of(frame), frame_of(plane), vec3(normal), radius});
            b.p->contacts.push_back(block);
            return block;
        }, "name"_a, "frame"_a, "plane"_a, "normal"_a, "radius"_a)
        .def("add_frame", [](Builder& b, Text name, Placed frame1, Placed frame2) {
            return b.add_constraint(name, FrameRows{frame_of(frame1), frame_of(frame2)});
        }, "name"_a, "frame1"_a, "frame2"_a)
        .def("add_hinge", [](Builder& b, Text name, Placed frame1, Placed frame2, Three axis, Three normal1,
                             Three normal2) {
            return b.add_constraint(name, HingeRows{frame_of(frame1), frame_of(frame2), vec3(axis), vec3(normal1),
                                              vec3(normal2)});
        }, "name"_a, "frame1"_a, "frame2"_a, "axis"_a, "normal1"_a, "normal2"_a)
        .def("add_distance", [](Builder& b, Text name, Placed frame1, Placed frame2, nb::object length) {
            return b.add_constraint(name, DistanceRows{frame_of(frame1), frame_of(frame2), time_function(length)});
        }, "name"_a, "frame1"_a, "frame2"_a, "length"_a)
        .def("add_knife", [](Builder& b, Text name, Placed frame, Three axis) {
            return b.add_constraint(name, KnifeRows{frame_of(frame), Frame{}, vec3(axis)});
        }, "name"_a, "frame"_a, "axis"_a)
        .def("add_rolling", [](Builder& b, Text name, Placed frame, Placed plane, double radius, bool sphere,
                               Three axle, Three tangent1, Three tangent2, Three normal) {
            return b.add_constraint(name, RollingRows{frame_of(frame), frame_of(plane), radius, sphere, vec3(axle),
                                                vec3(tangent1), vec3(tangent2), vec3(normal)});
        }, "name"_a, "frame"_a, "plane"_a, "radius"_a, "sphere"_a, "axle"_a, "tangent1"_a, "tangent2"_a, "normal"_a);
}

void bind_on_dofs(nb::class_<Builder>& builder) {
    builder
        .def("add_coupling", [](Builder& b, Text name, int joint1, int joint2, double ratio, double offset,
                                double period, bool position) {
            return b.add_constraint(name, CouplingRows{joint1, joint2, ratio, offset, period, position});
        }, "name"_a, "joint1"_a, "joint2"_a, "ratio"_a, "offset"_a, "period"_a, "position"_a)
        .def("add_motion", [](Builder& b, Text name, int joint, nb::object function, double period) {
            return b.add_constraint(name, MotionRows{joint, time_function(function), period});
        }, "name"_a, "joint"_a, "function"_a, "period"_a)
        .def("add_user", [](Builder& b, Text name, int size, nb::object rows, nb::object residual, nb::object rate) {
            return b.add_constraint(name, user_rows(size, rows, residual, rate));
        }, "name"_a, "size"_a, "rows"_a, "residual"_a.none(), "rate"_a.none());
}

void bind_slip_directions(nb::class_<Builder>& builder) {
    builder
        .def("add_dof_slip", [](Builder& b, Text name, int dof, int count) { return b.add_direction(name, DofRows{dof,
                                count}); },
             "name"_a, "dof"_a, "count"_a)
        .def("add_hinge_slip", [](Builder& b, Text name, Placed frame1, Placed frame2, Three axis) {
            return b.add_direction(name, HingeSlipRows{frame_of(frame1), frame_of(frame2), vec3(axis)});
        }, "name"_a, "frame1"_a, "frame2"_a, "axis"_a)
        .def("add_contact_slip", [](Builder& b, Text name, Placed frame, Placed plane, double radius, Three tangent1,
                                    Three tangent2, Three normal) {
            return b.add_direction(name, ContactSlipRows{frame_of(frame), frame_of(plane), radius, vec3(tangent1),
                                                   vec3(tangent2), vec3(normal)});
        }, "name"_a, "frame"_a, "plane"_a, "radius"_a, "tangent1"_a, "tangent2"_a, "normal"_a)
        .def("add_user_slip", [](Builder& b, Text name, nb::object direction) { return b.add_direction(name,
                                 slip_row(direction)); },
             "name"_a, "direction"_a);
}

}  // namespace

void bind_constraints(nb::class_<Builder>& builder) {
    bind_between_bodies(builder);
    bind_on_dofs(builder);
    bind_slip_directions(builder);
}

}  // namespace pn
