// A kind of constraint without declared properties must not compile.
#include "constraints/row_completeness.hpp"

struct NoKind {};
static_assert(pn::is_complete<NoKind>());
