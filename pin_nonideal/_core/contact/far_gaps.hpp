// Which open contacts are sure to be open still: points of a body have moved since its contacts were looked at by no more
// than its origin has and its turning moves them, and a gap changes by no more than its two bodies do.
#pragma once

#include "dynamics/workspace.hpp"

namespace pn {

class FarGaps {
public:
    explicit FarGaps(const Program& p);

    // Calls look(gap), which measures it for the bodies placed in the workspace and returns its width, for all gaps
    // but those that are sure to be open.
    template <class Look>
    void each_near(const Workspace& w, Look look) {
        for (Pair& pair : pairs_) {
            const double moved = pair.known ? move(w, pair) : HUGE_VAL;
            if (moved < pair.least) continue;
            pair.looks += look_where_near(pair, moved, look);
            if (pair.known && pair.looks <= static_cast<int>(pair.gaps.size())) continue;
            take(w, pair);
            pair.least = HUGE_VAL;
            for (Of& gap : pair.gaps) {
                gap.width = gap.near ? gap.now : look(gap.index);
                pair.least = std::min(pair.least, gap.width);
            }
        }
    }
    void forget() {
        for (Pair& pair : pairs_) pair.known = false;
    }

private:
    struct Of {  // of a gap
        int index;
        double width = 0.0;  // when all of the pair were looked at
        double now = 0.0;    // where it is near
        bool near = false;
    };
    struct Side {  // of a pair: how far from its body's origin its points reach, and where that was
        int joint = 0;
        double arm = 0.0;
        Vec3 origin = Vec3::Zero();
        Mat3 R = Mat3::Identity();
    };
    struct Pair {  // of bodies
        Side sides[2];
        std::vector<Of> gaps;
        double least = 0.0;  // width
        bool known = false;
        int looks = 0;       // since then
    };

    template <class Look>
    static int look_where_near(Pair& pair, double moved, Look look) {
        int looks = 0;
        for (Of& gap : pair.gaps) {
            gap.near = !(moved < gap.width);
            if (!gap.near) continue;
            gap.now = look(gap.index);
            ++looks;
        }
        return looks;
    }
    static double move(const Workspace& w, const Pair& pair);
    static void take(const Workspace& w, Pair& pair);

    std::vector<Pair> pairs_;
};

}  // namespace pn
