// A kind of constraint that says nothing of itself must not compile.
#include "constraints/kinds/complete.hpp"

struct NoKind {};
static_assert(pn::is_complete<NoKind>());
