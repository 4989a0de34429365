// A kind of constraint that says nothing of itself must not compile.
#include "constraints/row_completeness.hpp"

struct NoKind {};
static_assert(pn::is_complete<NoKind>());
