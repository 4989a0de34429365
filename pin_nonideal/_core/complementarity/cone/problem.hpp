// Contact and friction forces f of several elements together, whose velocities or accelerations are w = W f + w0.
//
// A contact has the rows (normal, slip directions), one, two or three of them. Its force is in the cone
// |f_t| <= mu f_n, u = w + (mu |w_t|, 0) in the dual cone, and the two are complementary, f . u = 0: that is w_n >= 0 and
// f_n >= 0 with f_n w_n = 0, and f_t = -mu f_n w_t / |w_t| where it slips (de Saxce, Feng, "The bipotential method",
// Math. Comput. Modelling 28, 1998). A box is dry friction of a known limit, |f| <= limit, f = -limit w / |w| where it
// slips. Numbers in the order of the elements, in units in which the largest w0 and the responses of each are about 1.
#pragma once

#include <vector>

#include "complementarity/small_dense.hpp"

namespace pn {

struct ConeElement {
    enum class Kind { contact, box, equality };  // equality: w = 0, whatever force that takes

    Kind kind = Kind::contact;
    int dim = 3;
    double bound = 0.0;  // mu of a contact, limit of a box

    static ConeElement contact(int dim, double mu) { return {Kind::contact, dim, mu}; }
    static ConeElement box(int dim, double limit) { return {Kind::box, dim, limit}; }
    bool slides() const { return kind == Kind::contact && dim > 1; }
    bool is(Kind k) const { return kind == k; }
};

class ConeProblem {
public:
    int n = 0;
    bool associated = false;  // u = w: slip opens the contact as if the cone were the potential
    std::vector<ConeElement> elements;
    std::vector<int> at;  // first row of each

    // Takes over W, w0 and the elements, scaled.
    void pose(const Eigen::Ref<const MatX>& W, const Eigen::Ref<const VecX>& w0,
              const std::vector<ConeElement>& elements);

    Eigen::Map<MatX> W() { return W_.matrix(n, n); }
    Eigen::Map<VecX> w0() { return w0_.vector(n); }
    Eigen::Map<const MatX> W() const { return W_.matrix(n, n); }
    Eigen::Map<const VecX> w0() const { return w0_.vector(n); }
    Eigen::Map<const VecX> scale() const { return scale_.vector(n); }  // forces are force_unit scale_i f_i
    double force_unit() const { return unit_; }
    int size() const { return static_cast<int>(elements.size()); }
    // The force that an element answers a unit of velocity with.
    double stiffness(int e) const { return stiffness_.vector(size())[e]; }

    void respond(const Eigen::Ref<const VecX>& f, Eigen::Ref<VecX> w) const {
        w = w0();
        w.noalias() += W() * f;
    }
    // What the errors of each element's equations are parts of: the largest w0, and what forces much larger than that
    // round to. Forces that only squeeze do not make an error small.
    void forces_in_play(const Eigen::Ref<const VecX>& f, Eigen::Ref<VecX> size) const;

private:
    void measure();

    Buffer W_, w0_, scale_, stiffness_;
    double unit_ = 1.0;
};

}  // namespace pn
