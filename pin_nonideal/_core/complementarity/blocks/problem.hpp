// Contact and friction forces f of many elements on separate trees of bodies, without the matrix of their responses.
//
// A node is a tree with its inertia matrix M. An element acts on one or two nodes:
//     M (x - free) = J^T f,   w = J x + offset,
// with x the accelerations, or the velocities at the end of a step divided by its length. cone/problem.hpp states the laws
// between f and w. M has one block per node, and J one block for each node of an element. Matrices are stored in row-major
// order. Free bodies may have mass-normalized unknowns L^T x, with M = L L^T: their inertia is then the identity.
#pragma once

#include <vector>

#include "complementarity/cone/problem.hpp"

namespace pn {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using BlockMap = Eigen::Map<RowMajor>;
using ConstBlockMap = Eigen::Map<const RowMajor>;

// Response below which a direction of an element counts as immovable, relative to its other directions.
constexpr double min_block_response = 1e-13;

struct BlockNode {
    int size = 0, first = 0;  // number of unknowns, and the first in x
    int M = 0;                // first entry of M and of its factor
    bool normalized = false;  // has mass-normalized unknowns
};

struct BlockElement {
    ConeElement cone;
    int row = 0;              // first row of f, w and offset
    int node[2] = {-1, -1};   // the second one is -1 for an element of one node
    int J[2] = {0, 0};        // first entries of the blocks of J
    int column = -1;          // only nonzero column of a single row on one node
    bool rests = true;        // the element keeps its rest if forces can hold it

    int dim() const { return cone.dim; }
    int head() const { return cone.is(ConeElement::Kind::contact) ? 1 : 0; }  // rows of the normal
};

class BlockProblem {
public:
    std::vector<BlockNode> nodes;
    std::vector<BlockElement> elements;
    std::vector<double> M, J;
    VecX free, offset;  // x without forces per unknown of the whole scene, and offset per row
    int rows = 0;

    void clear();
    // Add a node for the unknowns first ... first + size - 1, and return its block of M, set to zero.
    BlockMap add_node(int size, int first);
    // Add an element on one node or two, and return its index. Its blocks of J are zero.
    int add_element(const ConeElement& cone, int node, int other = -1);
    BlockMap jacobian(const BlockElement& e, int side) {
        return {J.data() + e.J[side], e.dim(), nodes[e.node[side]].size};
    }
    ConstBlockMap jacobian(const BlockElement& e, int side) const {
        return {J.data() + e.J[side], e.dim(), nodes[e.node[side]].size};
    }
    // Factor the blocks of M. Returns false if one is not positive definite.
    bool factor();
    // Change J to mass-normalized unknowns of the free bodies, once M is factored. Nodes with elements on single unknowns
    // keep their unknowns.
    void normalize();
    // Change x on all nodes to the unknowns of the problem, and back.
    void to_unknowns(VecX& x) const;
    void from_unknowns(VecX& x) const;
    // x := M^-1 x on a node.
    void solve_mass(int node, VecX& x) const;
    // w = J x of an element or of several, at their rows.
    void respond(const BlockElement& e, const VecX& x, VecX& w) const;
    void respond(const std::vector<int>& elements, const VecX& x, VecX& w) const;
    // x += J^T f of an element or of several.
    void push(const BlockElement& e, const VecX& f, VecX& x) const;
    void push(const std::vector<int>& elements, const VecX& f, VecX& x) const;
    // Compute the responses of the rows of listed elements to the element's own forces, J M^-1 J^T, per element.
    void own_responses(const std::vector<int>& elements, std::vector<Mat3>& W) const;

private:
    void respond_inline(const BlockElement& e, const VecX& x, VecX& w) const;
    void push_inline(const BlockElement& e, const VecX& f, VecX& x) const;

    std::vector<double> L_;  // lower Cholesky factors of the blocks of M
    // Nodes whose unknowns are not normalized, sides of elements on each, as twice the element plus the side, and the rows
    // of these elements as columns.
    mutable std::vector<int> touched_;
    mutable std::vector<std::vector<int>> sides_;
    mutable std::vector<double> columns_;
};

}  // namespace pn
