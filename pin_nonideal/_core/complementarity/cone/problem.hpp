// Contact and friction forces f of several elements together, with the velocities or accelerations w = W f + w0.
//
// A contact has one to three rows (normal, slip directions). The force of a contact is in the cone |f_t| <= mu f_n, and u =
// w + (mu |w_t|, 0) is in the dual cone. Both are complementary, f . u = 0. That is w_n >= 0 and f_n >= 0 with f_n w_n = 0,
// and f_t = -mu f_n w_t / |w_t| if the contact slips (de Saxce, Feng, "The bipotential method", Math. Comput. Modelling 28,
// 1998). A box is dry friction of a known limit: |f| <= limit, and f = -limit w / |w| if the element slips. Numbers are in
// the order of the elements. Units are scaled so that the largest w0 and the responses of each element are about 1.
#pragma once

#include <vector>

#include "complementarity/small_dense.hpp"

namespace pn {

struct ConeElement {
    enum class Kind { contact, box, equality };  // equality: w = 0 by any force

    Kind kind = Kind::contact;
    int dim = 3;
    double bound = 0.0;  // mu of a contact, limit of a box

    static ConeElement contact(int dim, double mu) { return {Kind::contact, dim, mu}; }
    static ConeElement box(int dim, double limit) { return {Kind::box, dim, limit}; }
    bool slides() const { return kind == Kind::contact && dim > 1; }
    bool is(Kind k) const { return kind == k; }
};
using ConeKind = ConeElement::Kind;

struct ConeProblemParameters {
    // Smallest response of an element that counts, relative to the largest response.
    double min_element_response = 1e-14;
    // Fraction of large forces that counts as their rounding error: 1e12 times the machine precision.
    double squeeze = 1e-4;
};

class ConeProblem {
public:
    using Parameters = ConeProblemParameters;
    static constexpr Parameters parameters{};

    int n = 0;
    bool associated = false;  // u = w (associated law): slip opens the contact
    std::vector<ConeElement> elements;
    std::vector<int> at;  // first row of each element

    // Copy W, w0 and the elements, and scale them.
    void pose(const Eigen::Ref<const MatX>& W, const Eigen::Ref<const VecX>& w0,
              const std::vector<ConeElement>& elements);

    Eigen::Map<MatX> W() { return W_.matrix(n, n); }
    Eigen::Map<VecX> w0() { return w0_.vector(n); }
    Eigen::Map<const MatX> W() const { return W_.matrix(n, n); }
    Eigen::Map<const VecX> w0() const { return w0_.vector(n); }
    Eigen::Map<const VecX> scale() const { return scale_.vector(n); }  // forces are force_unit scale_i f_i
    double force_unit() const { return unit_; }
    int size() const { return static_cast<int>(elements.size()); }
    // Return the force of element e per unit of velocity.
    double stiffness(int e) const { return stiffness_.vector(size())[e]; }

    void respond(const Eigen::Ref<const VecX>& f, Eigen::Ref<VecX> w) const {
        w = w0();
        w.noalias() += W() * f;
    }
    // Compute the scale of the errors of each element's equations: the response to the largest w0, plus the rounding error
    // of much larger forces. The scale grows only by a small part of the forces, so that forces without a response do not
    // hide an error.
    void force_scales(const Eigen::Ref<const VecX>& f, Eigen::Ref<VecX> size) const;

private:
    void measure();

    Buffer W_, w0_, scale_, stiffness_;
    double unit_ = 1.0;
};

}  // namespace pn
