// Kinds of constraints without declared properties must not compile.
#include "constraints/row_completeness.hpp"

struct NoKind {};
static_assert(pn::is_complete<NoKind>());

struct NoBounds : pn::GapKind {
    pn::Frame frame1, frame2;
};
static_assert(pn::is_complete<NoBounds>());

struct NoShapes : pn::ShapeGap {
    pn::Frame frame1, frame2;
};
static_assert(pn::is_complete<NoShapes>());
