#include "python/contact_geometry.hpp"

#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/vector.h>

#include "dynamics/workspace.hpp"
#include "python/arrays.hpp"

using namespace nanobind::literals;

namespace pn {

namespace {

// Check that blocks and states belong to the program.
void check_states(const Program& p, const Array2& q, size_t times, const std::vector<int>& blocks) {
    if (q.shape(1) != static_cast<size_t>(p.mechanism.nq) || q.shape(0) != times)
        throw std::invalid_argument("the states do not fit the model");
    for (const int block : blocks)
        if (block < 0 || block >= static_cast<int>(p.blocks.size())) throw std::invalid_argument("no such block");
}

// Place the bodies at each state and evaluate a part of each block, with `take(block, values)` after it.
template <class Take>
void evaluate_blocks(const Program& p, const Array2& q, const Array& t, const std::vector<int>& blocks, Part part,
                     const Take& take) {
    check_states(p, q, t.shape(0), blocks);
    Terms terms;
    terms.allocate(p.mechanism);
    std::vector<RowValues> values(blocks.size());
    for (size_t i = 0; i < blocks.size(); ++i) values[i].resize(RowStorage(p.blocks[blocks[i]].kind), p.mechanism.nv);
    const VecX at_rest = VecX::Zero(p.mechanism.nv);
    for (size_t k = 0; k < t.shape(0); ++k) {
        const VecX at = map(q).row(k);
        kinematics(p.mechanism, terms, at, at_rest);
        const State state{p.mechanism, terms, t(k), terms.q, at_rest};
        for (size_t i = 0; i < blocks.size(); ++i) {
            const Block& block = p.blocks[blocks[i]];
            evaluate(block.kind, state, part, values[i]);
            take(block, values[i]);
        }
    }
}

// Residual of the last row of each block at each state, (n, blocks). The last row of a contact is its gap [m, rad].
Table gap_values(const Program& p, const Array2& q, const Array& t, const std::vector<int>& blocks) {
    std::vector<double> gaps;
    gaps.reserve(t.shape(0) * blocks.size());
    evaluate_blocks(p, q, t, blocks, Part::residual, [&](const Block& block, const RowValues& values) {
        gaps.push_back(values.residual[block.total - 1]);
    });
    return to_table(std::move(gaps), t.shape(0), blocks.size());
}

// Six numbers in world axes for each block between two frames at each state, (n, 6 blocks): a point on the line of the
// normal force [m], and the normal along which the row pushes the body of frame 1.
Table action_lines(const Program& p, const Array2& q, const Array& t, const std::vector<int>& blocks) {
    std::vector<double> lines;
    lines.reserve(t.shape(0) * blocks.size() * 6);
    evaluate_blocks(p, q, t, blocks, Part::place, [&](const Block&, const RowValues& values) {
        const Wrench& unit = values.wrench[0];
        for (const Vec3& part : {unit.point, unit.force})
            for (int k = 0; k < 3; ++k) lines.push_back(part[k]);
    });
    return to_table(std::move(lines), t.shape(0), 6 * blocks.size());
}

// Two slip directions of each friction element at a state in world axes, (elements, 6): the friction force pushes the
// body of frame 1 along them.
Table slip_axes(const Program& p, const Array2& q, const Array& t, const std::vector<int>& elements) {
    std::vector<int> blocks;
    for (const int element : elements) {
        if (element < 0 || element >= static_cast<int>(p.frictions.size()) || p.frictions[element].dim != 2)
            throw std::invalid_argument("elements must be indices of friction elements with two directions");
        blocks.push_back(p.frictions[element].block);
    }
    std::vector<double> axes;
    evaluate_blocks(p, q, t, blocks, Part::place, [&](const Block&, const RowValues& values) {
        for (int row = 0; row < 2; ++row)
            for (int k = 0; k < 3; ++k) axes.push_back(values.wrench[row].force[k]);
    });
    return to_table(std::move(axes), t.shape(0) * elements.size(), 6);
}

}  // namespace

void bind_contact_geometry(nb::module_& m) {
    m.def("gap_values", &gap_values, "program"_a, "q"_a, "t"_a, "blocks"_a);
    m.def("action_lines", &action_lines, "program"_a, "q"_a, "t"_a, "blocks"_a);
    m.def("slip_axes", &slip_axes, "program"_a, "q"_a, "t"_a, "elements"_a);
}

}  // namespace pn
