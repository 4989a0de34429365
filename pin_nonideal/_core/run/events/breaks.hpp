// Times at which functions of time break: steps end there, and the next step takes the functions as they are behind. If
// the rate of a prescribed motion jumps, an impulse of the motion's rows makes the velocity jump.
#pragma once

#include <optional>
#include <vector>

#include "math/time_function.hpp"
#include "run/output/output.hpp"

namespace pn {

class Breaks {
public:
    Breaks(System& system, Progress& progress, Output& output, Recording& out);

    // At the time now: rows are evaluated as behind the last break, and as before the next.
    void enter();
    // The next break, or infinity; and whether it is now.
    double next() const { return next_; }
    bool reached() const { return now_.t >= next_; }
    // Goes behind the break that was reached, where the rate is taken anew; whether the velocity has jumped. Modes of
    // contacts and friction behind a jump are still to be found.
    bool pass();
    // Looks for a break of a function of the user's in a step from now to `end`. A pulse that begins and ends within one of
    // its sixteen intervals is not seen.
    void look(double end, bool adaptive = true);

private:
    struct Motion {
        int block;
        const TimeFunction* function;
    };

    std::vector<double> rates(double t) const;
    void jump(const std::vector<double>& before, const std::vector<double>& after);
    void tell(const std::vector<double>& before, const std::vector<double>& after, const VecX& v_minus, const VecX& impulse);

    const Program& p;
    Workspace& w;
    System& system_;
    Progress& now_;
    Output& output_;
    Recording& out_;
    std::vector<Motion> motions_;
    double next_ = HUGE_VAL;
};

}  // namespace pn
