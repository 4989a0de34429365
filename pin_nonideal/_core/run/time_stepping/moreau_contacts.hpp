// Time stepping with contacts that may open (Moreau's midpoint rule): those whose gap has closed at the step's middle
// join, u_n + e u_n- >= 0 at its end with a percussion that presses, Coulomb's cone along it, and all other dry friction
// beside in its limits. One cone problem a step; the others are no rows.
#pragma once

#include <vector>

#include "complementarity/cone/solver.hpp"
#include "run/events/gap_watch.hpp"

namespace pn {

// Part of what they are rounded by that edges and rims may have entered each other for normals to be found.
constexpr double nearly_all = 0.999;

class MoreauContacts {
public:
    MoreauContacts(System& system, GapWatch& watch);

    // How long a step from y at t may be, up to h: what edges and rims that come at each other are rounded by is entered by
    // no more than half of it, and by half of what is left where they are inside. Deeper they tell no way out, and may be
    // behind each other.
    double allowed(double t, double h, const VecX& y);
    // One step of size h from y at t; the work of contacts along their normals goes into impact_energy, what the scheme
    // itself adds into moved_energy. The state is left to be projected and evaluated, with the modes of its end.
    void step(double t, double h, VecX& y, double& moved_energy, double& impact_energy);

private:
    struct Row {
        int block, k;
    };
    struct Part {              // of the cone problem
        int gap = -1;          // a contact's,
        int element = -1;      // and of dry friction: its sliding, or one that is a box
        double approach = 0.0; // restitution times the rate at which its gap closed, over the step
        double middle = 0.0;   // of the limits of a box of one direction
    };

    bool tells_way_out(int gap, double width) const { return width > -nearly_all * rounded_by_[gap]; }
    void select(const std::vector<char>& closed, const std::vector<Mode>& modes, bool flies);
    void solve_free(double t);
    const VecX& way_since_last();
    void find_touching(double t);
    void add_rows();
    void add_part(Part part, int first_block, int kept, ConeElement element);
    void respond();
    void measure_free();
    void measure_from_middles(double sign);
    bool keep_rest(bool solved);
    void solve(double t);
    void apply();
    bool limits_settle(double t);
    void end_velocity();
    void book_work(VecX& y, double& moved_energy, double& impact_energy);
    double coefficient(int element) const;

    System& system_;
    const Program& p;
    Workspace& w;
    double h_ = 0.0, last_change_ = 0.0;  // the second: of the limits, from pass to pass
    GapWatch& watch_;
    std::vector<int> touching_, own_;  // gaps that take part, and dry friction of no contact that may open
    std::vector<int> rubbing_;         // dry friction that takes part, but the sliding of contacts
    std::vector<char> was_closed_, closed_, open_;
    std::vector<Mode> modes_, unloaded_;
    std::vector<double> rounded_by_;   // of gaps
    bool rounded_ = false;             // some are
    bool marked_ = false;  // in the flags and modes of the last step something was closed or rubbed
    std::vector<Row> rows_;
    std::vector<Part> parts_;
    std::vector<ConeElement> cones_;
    bool scaled_ = true;   // the response is a_s = R^T a
    bool presses_ = true;  // there may be percussions of the last step
    VecX q_mid_, q_looked_, v0_, v1_, a_free_, lam_free_, w0_, w1_, f_, power_, unit_, zero_, force_, lam_;
    MatX W_, response_, multipliers_;
    ConeComplementarity solver_;
};

}  // namespace pn
