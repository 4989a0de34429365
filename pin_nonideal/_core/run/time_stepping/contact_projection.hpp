// Projection after a time step onto closed contacts, sticking friction and prescribed motions, on trees that no other
// constraint joins.
#pragma once

#include "complementarity/blocks/least_move.hpp"
#include "dynamics/tree_blocks.hpp"
#include "run/time_stepping/mean_velocity.hpp"

namespace pn {

struct ContactProjectionParameters {
    // Past the first moves, an iteration that keeps more than this fraction of the largest residual has reached rounding
    // error, or rows that contradict each other.
    double stall_ratio = 0.5;
    int sure_moves = 1, max_moves = 12;  // first moves, which `stall_ratio` does not judge, and maximum number of moves
    // Maximum height by which the moves may lift all bodies, relative to the largest gap that they close. Rows that nearly
    // contradict each other lift farther.
    double max_lift = 1.01;
    // Maximum number of choices of closed contacts.
    int max_choices = 4;
    // A contact that departs opens if its rate needs a pull above this multiple of the push of its step. Over an edge of
    // small rounding radius the normal turns within a step, and no load holds a body on the edge.
    double max_pull = 2.0;
};

// Rounding error of the gaps and rates of closed contacts at the end of a step with velocity v.
struct ContactRounding {
    double gap, rate;
    ContactRounding(const Program& p, const Workspace& w, const VecX& v);
};

class ContactProjection {
public:
    using Parameters = ContactProjectionParameters;
    static constexpr Parameters parameters{};

    explicit ContactProjection(const Program& p);

    // After a step of length h, project q and v onto the closed contacts and sticking elements of the workspace: gaps
    // close, and v satisfies their rows. Contacts open if other contacts hold their bodies apart. The move penetrates open
    // contacts of the list `near` by at most the travel of the step or the largest gap that closes. A tree that the rows
    // hold, with a velocity of the size of rounding errors, comes to rest. Return false if the trees cannot be projected one
    // by one. The state (q, v) is then undefined.
    bool project(const Program& p, Workspace& w, double t, double h, const std::vector<int>& near, VecX& q, VecX& v);
    // Check if motions are prescribed to joints.
    bool has_prescribed() const { return !blocks_.held().empty(); }
    double numerical_energy() const { return moved_energy_; }  // energy that the last projection added, if `energy`
    // Check if a closed contact that opens at this rate must open, for the impulse that pushed it in the step and its
    // response to a unit impulse.
    static bool departs(double rate, double impulse, double response) {
        return rate > parameters.max_pull * std::max(0.0, impulse) * response;
    }

    bool energy = false;  // measure the energy

private:
    void gather(const Program& p, const Workspace& w, bool sticks);
    bool pose(const Program& p, Workspace& w, bool sticks);
    // Fill r_ with the widths of the closed gaps, or with the rates of the rows. Return the largest.
    double measure_gaps(const Program& p, const Workspace& w);
    double measure_rates(const Program& p, Workspace& w, const VecX& v);
    bool is_projected(const Program& p, Workspace& w, const VecX& v);
    void meet_prescribed(const Program& p, Workspace& w, double t, VecX& q, VecX& v);
    bool correct(const Program& p, Workspace& w, double t, double h, const std::vector<int>& near, VecX& q, VecX& v);
    void measure_open(const Program& p, Workspace& w, double t, const std::vector<int>& near, const VecX& v);
    bool find_penetrating(const Program& p, Workspace& w, double t, const VecX& v, double allowed);
    bool close_gaps(const Program& p, Workspace& w, double t, VecX& q, VecX& v);
    bool open_departing_contacts(const Program& p, Workspace& w, double h, const VecX& v);
    bool is_open(const Program& p, const Workspace& w) const;
    bool open_blocked_contacts(const Program& p, Workspace& w);
    void meet_rates(const Program& p, Workspace& w, VecX& v);
    void rest(const Program& p, Workspace& w, VecX& v);
    void add(int block, int rows, bool joined);

    TreeBlocks blocks_;
    std::vector<MeanVelocity::FreeFlyer> flyers_;
    LeastMove least_;
    std::vector<StepRow> rows_;
    std::vector<ConeElement> elements_;
    std::vector<int> gap_;  // per row: gap whose residual it closes, -1 for sliding
    VecX r_, move_, q_from_, q_best_, v_best_, q_start_, v_start_;
    std::vector<char> closed_;
    std::vector<Mat3> responses_;  // own responses of the elements, per element
    std::vector<int> departing_;   // elements of contacts that depart
    struct Open {
        int gap;
        double width;  // before the projection, at most 0
    };
    std::vector<Open> open_, penetrating_;  // open contacts, and contacts that the moves let penetrate
    std::vector<double> width_;             // per row: width that its gap gets
    double moved_energy_ = 0.0, weight_ = 0.0;
};

}  // namespace pn
