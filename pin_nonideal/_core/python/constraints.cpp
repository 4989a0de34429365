#include "python/constraints.hpp"

#include <algorithm>

#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "python/callbacks.hpp"

using namespace nanobind::literals;

namespace pn {

std::vector<ConstraintRows> constraint_rows(const Program& p, const std::vector<int>& blocks) {
    std::vector<ConstraintRows> out;
    for (const int i : blocks) {
        if (i < 0 || i >= p.constraints) throw std::invalid_argument("no such block");
        const Block& block = p.blocks[i];
        ConstraintRows rows{block.name, block.user_row, block.total, {}, moves_in_time(block.kind), shown(block.kind)};
        for (int k = 0; k < block.total; ++k) rows.holonomic.push_back(is_holonomic(block.kind, k));
        out.push_back(std::move(rows));
    }
    return out;
}

std::vector<std::string> block_names(const Program& p) {
    std::vector<std::string> names;
    for (int i = 0; i < p.constraints; ++i) names.push_back(p.blocks[i].name);
    return names;
}

std::vector<int> first_rows(const Program& p) {
    std::vector<int> rows;
    for (int i = 0; i < p.constraints; ++i) rows.push_back(p.blocks[i].user_row);
    return rows;
}

std::vector<int> free_gaps(const Program& p) {
    std::vector<int> free;
    for (int i = p.first_gap; i < p.constraints; ++i) {
        const std::vector<DofSupport::Entry>& entries = p.blocks[i].entries();
        const auto floats = [&](const DofSupport::Entry& e) {
            return p.mechanism.joints[p.mechanism.dof_joint[e.dof]].kind == JointKind::free_flyer;
        };
        if (std::any_of(entries.begin(), entries.end(), floats)) free.push_back(i);
    }
    return free;
}

namespace {

// Conversion of a Python argument to a data member.
template <class Value>
struct From {
    using Argument = Value;
    static Value make(const Argument& x) { return x; }
};
template <>
struct From<SharedFrame> {
    using Argument = FrameTuple;
    static SharedFrame make(const Argument& x) { return SharedFrame(frame_of(x)); }
};
template <>
struct From<Vec3> {
    using Argument = std::vector<double>;
    static Vec3 make(const Argument& x) { return vec3(x); }
};
template <>
struct From<Box> {  // half of its sides
    using Argument = std::vector<double>;
    static Box make(const Argument& x) { return Box(vec3(x)); }
};
template <>
struct From<Hull> {  // corners, planes and edges, as flat lists
    using Argument = std::tuple<std::vector<double>, std::vector<double>, std::vector<int>>;
    static Hull make(const Argument& x) {
        const auto& [numbers, planes, edges] = x;
        std::vector<Vec3> corners;
        for (size_t k = 0; k + 2 < numbers.size(); k += 3)
            corners.emplace_back(numbers[k], numbers[k + 1], numbers[k + 2]);
        return Hull(corners, planes, edges);
    }
};
template <>
struct From<Revolved> {  // half the length, and the radii below and above
    using Argument = std::tuple<double, double, double>;
    static Revolved make(const Argument& x) { return std::make_from_tuple<Revolved>(x); }
};
template <>
struct From<TimeFunction> {
    using Argument = nb::object;
    static TimeFunction make(const Argument& x) { return time_function(x); }
};
template <class Signature>
struct From<std::function<Signature>> {  // user function, or None if it is optional
    using Argument = Function<typename Seen<Signature>::Type>;
    static std::function<Signature> make(const Argument& f) {
        return f ? user_function<Signature>(*f) : std::function<Signature>();
    }
};

// Bind Builder.add_<name>(name, data...) of one kind of rows. The arguments are the declared data of the kind.
template <class K, class... Value>
void bind_kind(nb::class_<Builder>& builder, const Field<K, Value>&... data) {
    builder.def((std::string("add_") + K::name).c_str(),
        [data...](Builder& b, const std::string& name, const typename From<Value>::Argument&... given) {
            K kind{};
            ((kind.*data.member = From<Value>::make(given)), ...);
            return b.add(name, std::move(kind), K::role);
        }, "name"_a, nb::arg(data.name)...);
}

template <class... K>
void bind_kinds(nb::class_<Builder>& builder, const std::variant<K...>*) {
    (std::apply([&](const auto&... data) { bind_kind<K>(builder, data...); }, K::data()), ...);
}

}  // namespace

void bind_constraints(nb::module_& m, nb::class_<Builder>& builder) {
    nb::class_<ConstraintRows>(m, "ConstraintRows")
        .def_ro("name", &ConstraintRows::name)
        .def_ro("first", &ConstraintRows::first)
        .def_ro("count", &ConstraintRows::count)
        .def_ro("holonomic", &ConstraintRows::holonomic)
        .def_ro("moves_in_time", &ConstraintRows::moves_in_time)
        .def_ro("shown", &ConstraintRows::shown);
    builder.def_prop_ro("block_names", [](const Builder& b) { return block_names(b.program()); });
    builder.def_prop_ro("first_rows", [](const Builder& b) { return first_rows(b.program()); });
    builder.def_prop_ro("rows", [](const Builder& b) { return b.program().user_rows; });
    bind_kinds(builder, static_cast<const Kind*>(nullptr));
}

}  // namespace pn
