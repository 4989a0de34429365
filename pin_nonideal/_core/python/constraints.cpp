// Constraints and directions of friction from plain numbers and functions, one entry a kind.
#include "python/callbacks.hpp"

#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

using namespace nanobind::literals;

namespace pn {

void bind_constraints(nb::class_<Builder>& builder) {
    builder
        .def("add_point", [](Builder& b, const std::string& name, const FrameTuple& f1, const FrameTuple& f2,
                             std::vector<int> axes) {
            return b.add(name, PointRows{frame_of(f1), frame_of(f2), std::move(axes)}, true);
        })
        .def("add_contact", [](Builder& b, const std::string& name, const FrameTuple& f1, const FrameTuple& f2,
                               const std::vector<double>& normal, double radius) {
            const int block = b.add(name, ContactRow{frame_of(f1), frame_of(f2), vec3(normal), radius}, true);
            b.p->contacts.push_back(block);
            return block;
        })
        .def("add_frame", [](Builder& b, const std::string& name, const FrameTuple& f1, const FrameTuple& f2) {
            return b.add(name, FrameRows{frame_of(f1), frame_of(f2)}, true);
        })
        .def("add_hinge", [](Builder& b, const std::string& name, const FrameTuple& f1, const FrameTuple& f2,
                             const std::vector<double>& axis, const std::vector<double>& n1,
                             const std::vector<double>& n2) {
            return b.add(name, HingeRows{frame_of(f1), frame_of(f2), vec3(axis), vec3(n1), vec3(n2)}, true);
        })
        .def("add_distance", [](Builder& b, const std::string& name, const FrameTuple& f1, const FrameTuple& f2,
                                nb::object length) {
            return b.add(name, DistanceRows{frame_of(f1), frame_of(f2), time_function(length)}, true);
        })
        .def("add_knife", [](Builder& b, const std::string& name, const FrameTuple& f1,
                             const std::vector<double>& axis) {
            return b.add(name, KnifeRows{frame_of(f1), Frame{}, vec3(axis)}, true);
        })
        .def("add_rolling", [](Builder& b, const std::string& name, const FrameTuple& f1, const FrameTuple& f2,
                               double radius, bool sphere, const std::vector<double>& axle,
                               const std::vector<double>& t1, const std::vector<double>& t2,
                               const std::vector<double>& n) {
            return b.add(name, RollingRows{frame_of(f1), frame_of(f2), radius, sphere, vec3(axle), vec3(t1), vec3(t2),
                                           vec3(n)}, true);
        })
        .def("add_coupling", [](Builder& b, const std::string& name, int joint1, int joint2, double ratio,
                                double offset, double period, bool position) {
            return b.add(name, CouplingRows{joint1, joint2, ratio, offset, period, position}, true);
        })
        .def("add_motion", [](Builder& b, const std::string& name, int joint, nb::object function, double period) {
            return b.add(name, MotionRows{joint, time_function(function), period}, true);
        })
        .def("add_user", [](Builder& b, const std::string& name, int size, nb::object rows, nb::object residual,
                            nb::object rate) {
            return b.add(name, user_rows(rows, residual, rate), true, size);
        }, "name"_a, "size"_a, "rows"_a, "residual"_a.none(), "rate"_a.none());
}

// Directions of friction, which follow all constraints.
void bind_slip_directions(nb::class_<Builder>& builder) {
    builder
        .def("add_dof_slip", [](Builder& b, const std::string& name, int dof, int count) {
            return b.add(name, DofRows{dof, count}, false);
        })
        .def("add_hinge_slip", [](Builder& b, const std::string& name, const FrameTuple& f1, const FrameTuple& f2,
                                  const std::vector<double>& axis) {
            return b.add(name, HingeSlipRows{frame_of(f1), frame_of(f2), vec3(axis)}, false);
        })
        .def("add_contact_slip", [](Builder& b, const std::string& name, const FrameTuple& f1, const FrameTuple& f2,
                                    double radius, const std::vector<double>& t1, const std::vector<double>& t2,
                                    const std::vector<double>& n) {
            return b.add(name, ContactSlipRows{frame_of(f1), frame_of(f2), radius, vec3(t1), vec3(t2), vec3(n)}, false);
        })
        .def("add_user_slip", [](Builder& b, const std::string& name, nb::object direction) {
            return b.add(name, slip_row(direction), false);
        });
}

}  // namespace pn
