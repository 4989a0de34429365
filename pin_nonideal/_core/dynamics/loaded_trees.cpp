#include "dynamics/loaded_trees.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "dynamics/reactions.hpp"

namespace pn {

bool are_limits_of_trees(const Unknowns& u) {
    return u.p.loads_are_of_trees && u.w.now.rows.blocks.empty() && !u.w.now.drives.active;
}

namespace {

// Wrench of a joint about its origin, from a wrench about the reference point of its body.
PN_INLINE Force about_origin(const BodyTerms& terms, int joint, Force r) {
    r.ang -= terms.body[joint].p.cross(r.lin);
    return r;
}

// Linearize the loads at the wrenches of the elements, and add their friction to the left axes of the sweep.
PN_WIDE void linearize(const BodyTerms& terms, std::vector<LoadedJoint>& elements, std::vector<Motion>& axis) {
    for (LoadedJoint& element : elements) {
        Motion& g = element.gradient;
        g = BearingLoad(*element.friction, element.axis, element.wrench).gradient();
        g.lin += terms.body[element.joint].p.cross(g.ang);  // about the reference point of the body
        for (int k = 0; k < element.friction->dim; ++k)
            axis[element.dof + k] += (-element.factor * element.along[k]) * g;
        element.rest = dot(g, element.beyond);  // the load is homogeneous in the wrench
    }
}

// Compute the loads under the reactions of the sweep, and their limits y. Return the largest change of a limit by the part
// of its load that is not linear.
PN_WIDE double load(const BodyTerms& terms, const ObliqueSweep& sweep, std::vector<LoadedJoint>& elements, VecX& y) {
    double error = 0.0;
    for (size_t k = 0; k < elements.size(); ++k) {
        LoadedJoint& element = elements[k];
        const Force& r = sweep.reaction[element.joint];
        element.wrench = r;
        element.wrench += element.beyond;
        element.wrench = about_origin(terms, element.joint, element.wrench);
        const double load = BearingLoad(*element.friction, element.axis, element.wrench).size();
        const double rest = load - dot(element.gradient, r);
        error = std::max(error, element.factor * std::abs(rest - element.rest));
        element.rest = rest;
        y[k] = element.factor * (element.friction->constant + load);
    }
    return error;
}

struct LoadedTrees {
    Unknowns& u;
    const Program& p;
    Workspace& w;
    LoadedJoints& loaded;
    const bool deep, shallow;  // there are such trees

    explicit LoadedTrees(Unknowns& unknowns)
        : u(unknowns), p(u.p), w(u.w), loaded(u.w.scratch.loaded), deep(!p.mechanism.deep_joints.empty()),
          shallow(p.mechanism.deep_joints.size() + 1 < p.mechanism.joints.size()) {}

    // Describe the slipping elements: with the wrenches of the last solution, or with loads fixed at the limits y.
    void describe(const VecX& y, bool has_wrenches) {
        loaded.known = (deep ? w.now.joint_F : w.now.F) + w.now.base_C;
        for (int e : w.now.slipping)
            if (p.frictions[e].reaction == Reaction::ideal) add_slip_force(p, w, e, loaded.known);
        if (shallow) sum_subtree_forces(p, w, w.now.reactions.body);
        loaded.elements.resize(u.n);
        int k = 0;
        u.each([&](size_t e) {
            const Friction& f = p.frictions[e];
            LoadedJoint& element = loaded.elements[k];
            element.friction = &f;
            element.joint = f.joint;
            element.dof = p.blocks[f.block].dof;
            element.factor = limit_under(p, w, static_cast<int>(e), 1.0);
            element.axis = bearing_axis(w.now.terms, f);
            element.along = force_direction(p, w, static_cast<int>(e));
            if (has_wrenches) element.wrench = w.state.bearing_wrench[e];
            else element.rest = element.factor > 0.0 ? y[k] / element.factor - f.constant : 0.0;
            element.beyond = Force{};
            if (!p.mechanism.joints[f.joint].deep) {  // the bias and the forces on the subtree are generalized forces
                element.beyond = w.now.terms.body[f.joint].f;
                element.beyond -= w.now.reactions.body[f.joint];
            }
            ++k;
        }, [](const UserLaw&) {});
    }

    // Linearize at the wrenches of the elements.
    bool renew_gradients() {
        loaded.sweep.axis = w.now.terms.J;
        linearize(w.now.terms, loaded.elements, loaded.sweep.axis);
        return loaded.sweep.factorize(p.mechanism, w.now.terms);
    }

    // Solve the linear motion, and compute the limits y of its loads. Return the largest change of a limit by the part of
    // its load that is not linear.
    double step(VecX& y) {
        VecX& x = loaded.x;
        x = loaded.known;
        for (const LoadedJoint& element : loaded.elements)
            for (int k = 0; k < element.friction->dim; ++k)
                x[element.dof + k] += element.factor * element.along[k] * (element.friction->constant + element.rest);
        loaded.sweep.solve(p.mechanism, w.now.terms, deep ? w.now.wrench.data() : nullptr, x);
        ++w.counters.iterations;
        return load(w.now.terms, loaded.sweep, loaded.elements, y);
    }

    bool is_rounding(double error, const VecX& y) const {
        return error <= loaded_trees_parameters.tolerance * y.head(u.n).cwiseAbs().maxCoeff();
    }

    // Step with the current gradients while this converges fast. Return true at the solution.
    bool settle(VecX& y) {
        double last = std::numeric_limits<double>::infinity();
        for (;;) {
            const double error = step(y);
            if (is_rounding(error, y)) return true;
            if (!(error < last))
                return error <= loaded_trees_parameters.stall_tolerance * y.head(u.n).cwiseAbs().maxCoeff();
            if (error > loaded_trees_parameters.max_contraction * last) return false;
            last = error;
        }
    }

    // Factorize without gradients: loads are constant.
    bool fix_loads() {
        for (LoadedJoint& element : loaded.elements) element.gradient = Motion{};
        loaded.sweep.axis = w.now.terms.J;
        return loaded.sweep.factorize(p.mechanism, w.now.terms);
    }

    // Loads under a unit limit of each element alone. The reaction to it is linear, so that no load grows faster.
    void bound(MatX& L) {
        L.resize(u.n, u.n);
        fix_loads();
        for (int column = 0; column < u.n; ++column) {
            const LoadedJoint& source = loaded.elements[column];
            loaded.x.setZero();
            for (int k = 0; k < source.friction->dim; ++k) loaded.x[source.dof + k] += source.along[k];
            loaded.sweep.solve(p.mechanism, w.now.terms, nullptr, loaded.x);
            for (int row = 0; row < u.n; ++row) {
                const LoadedJoint& element = loaded.elements[row];
                const Force wrench = about_origin(w.now.terms, element.joint, loaded.sweep.reaction[element.joint]);
                L(row, column) = element.factor * BearingLoad(*element.friction, element.axis, wrench).size();
            }
        }
        w.counters.iterations += u.n;
    }

    // Set the motion of the last step for the limits y. This acceleration has the accuracy of the sweep. In shallow
    // trees the factor of M is more accurate.
    void accept(const VecX& y) {
        u.set(y);
        int k = 0;
        u.each([&](size_t e) {
            const LoadedJoint& element = loaded.elements[k++];
            const double load = dot(element.gradient, loaded.sweep.reaction[element.joint]) + element.rest;
            w.now.load[e] = element.friction->constant + load;
            w.state.bearing_wrench[e] = element.wrench;
        }, [](const UserLaw&) {});
        if (shallow) return u.motion();
        w.now.C = w.now.base_C;
        add_slip_forces(p, w, true, w.now.C);
        w.now.renew();
        w.now.a = loaded.x;
    }

    // Solve from the wrenches of the last solution, or from the limits y.
    bool solve(VecX& y, bool has_wrenches) {
        describe(y, has_wrenches);
        bool is_solved = false;
        if (!has_wrenches) {
            if (!fix_loads()) return false;
            is_solved = is_rounding(step(y), y);
        }
        for (int it = 0; it < loaded_trees_parameters.max_gradients && !is_solved; ++it) {
            if (!y.head(u.n).allFinite() || !renew_gradients()) return false;
            if (!(loaded.sweep.least_relative_pivot(w.now.terms) > loaded_trees_parameters.min_pivot)) return false;
            is_solved = settle(y);
        }
        if (!is_solved || !y.head(u.n).allFinite()) return false;
        if (!(loaded.sweep.relative_determinant(w.now.terms) > loaded_trees_parameters.min_determinant)) return false;
        accept(y);
        return true;
    }
};

}  // namespace

void bound_loads_of_trees(Unknowns& unknowns, MatX& L) { LoadedTrees(unknowns).bound(L); }

bool solve_loaded_trees(Unknowns& unknowns, VecX& y, bool has_wrenches) {
    return LoadedTrees(unknowns).solve(y, has_wrenches);
}

}  // namespace pn
