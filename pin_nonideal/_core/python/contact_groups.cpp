#include "python/contact_groups.hpp"

#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

using namespace nanobind::literals;

namespace pn {

namespace {

// Return the name of a point of a pair of shapes.
std::string numbered(const std::string& name, int number) { return name + " " + std::to_string(number); }

// Check if rows have a member frame1.
template <class Rows>
constexpr auto has_frame1(int) -> decltype(std::declval<Rows>().frame1, true) { return true; }
template <class Rows>
constexpr bool has_frame1(long) { return false; }

using Line = std::tuple<FrameTuple, double>;  // frame at the center, z along the line, and half the length

// Call `add` with the name and both lines of each pair. Names are numbered from `number` on.
template <class Add>
void each_pair(const std::string& name, int number, const std::vector<Line>& lines1, const std::vector<Line>& lines2,
               const Add& add) {
    std::vector<std::pair<SharedFrame, double>> others;
    for (const auto& [frame, half] : lines2) others.emplace_back(frame_of(frame), half);
    for (const auto& [tuple, half1] : lines1) {
        const SharedFrame frame1 = frame_of(tuple);
        for (const auto& [frame2, half2] : others)
            add(numbered(name, number++), frame1, frame2, half1, half2);
    }
}

// Return rows between the same shapes with another frame 1. Frame 1 of the friction rows of a contact is that of its gap.
Kind with_frame1(Kind rows, const SharedFrame& frame1) {
    std::visit([&](auto& kind) {
        if constexpr (has_frame1<std::decay_t<decltype(kind)>>(0)) kind.frame1 = frame1;
        else throw std::invalid_argument("these rows have no frame 1");
    }, rows);
    return rows;
}

void repeat_contact(Builder& b, const std::string& name, int number, const std::vector<FrameTuple>& frames1) {
    const double restitution = b.program().gaps.back().restitution;
    const Kind like = b.program().blocks.back().kind;
    for (const FrameTuple& frame1 : frames1) {
        b.add(numbered(name, number++), with_frame1(like, SharedFrame(frame_of(frame1))), Role::contact);
        b.set_unilateral(restitution);
    }
}

void repeat_contact_friction(Builder& b, const std::string& name, int number, const std::vector<FrameTuple>& frames1) {
    Friction friction = b.program().frictions.back();
    const Kind like = b.program().blocks[friction.block].kind;
    for (const FrameTuple& frame1 : frames1) {
        friction.name = numbered(name, number++);
        friction.law = b.add_law(friction.name);
        friction.block = b.add(friction.name, with_frame1(like, SharedFrame(frame_of(frame1))), Role::direction);
        ++friction.anchor;
        b.edit().frictions.push_back(friction);
    }
}

}  // namespace

void bind_contact_groups(nb::class_<Builder>& builder) {
    builder
        .def("repeat_contact", &repeat_contact, "name"_a, "number"_a, "frames1"_a)
        .def("repeat_contact_friction", &repeat_contact_friction, "name"_a, "number"_a, "frames1"_a)
        .def("add_capsule_pairs", [](Builder& b, const std::string& name, int number, const std::vector<Line>& lines1,
                                     const std::vector<Line>& lines2, double radius, double restitution) {
            const int first = static_cast<int>(b.program().blocks.size());
            each_pair(name, number, lines1, lines2,
                      [&](const std::string& own, const SharedFrame& f1, const SharedFrame& f2, double half1, double half2) {
                b.add(own, CapsuleCapsuleRow{{}, f1, f2, half1, half2, radius}, Role::contact);
                b.set_unilateral(restitution);
            });
            return first;
        }, "name"_a, "number"_a, "lines1"_a, "lines2"_a, "radius"_a, "restitution"_a)
        .def("add_capsule_pair_friction", [](Builder& b, const std::string& name, int number,
                                             const std::vector<Line>& lines1, const std::vector<Line>& lines2,
                                             double radius1, int first, double mu, double static_ratio) {
            int anchor = first;
            each_pair(name, number, lines1, lines2,
                      [&](const std::string& own, const SharedFrame& f1, const SharedFrame& f2, double half1, double half2) {
                Friction f;
                f.name = own;
                f.law = b.add_law(own);
                f.block = b.add(own, CapsuleCapsuleSlipRows{{}, f1, f2, half1, half2, radius1}, Role::direction);
                f.dim = b.program().blocks[f.block].total;
                f.load = Friction::Load::multiplier;
                f.reaction = Reaction::total;
                f.anchor = anchor++;
                f.mu = mu;
                f.static_ratio = static_ratio;
                b.edit().frictions.push_back(std::move(f));
            });
        }, "name"_a, "number"_a, "lines1"_a, "lines2"_a, "radius1"_a, "first"_a, "mu"_a, "static_ratio"_a);
}

}  // namespace pn
