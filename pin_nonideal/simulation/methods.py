"""Integration methods of the core and of SciPy, by name."""

from __future__ import annotations

from pin_nonideal.core_loader import core

# Integration methods by name, with a flag for adaptive steps.
METHODS = {method.name: method.adaptive for method in core.methods()}
# Methods of SciPy, and its one-step methods, which can continue from a projected state.
SCIPY = tuple(method.name for method in core.methods() if method.outside)
ONE_STEP = tuple(method.name for method in core.methods() if method.outside and method.one_step)
