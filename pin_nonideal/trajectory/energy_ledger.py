"""Energy ledger of a run: stored energies, work since the start, and their balance.

The core integrates the powers (`dynamics/power.cpp`) with the state, and records the stored energies and the
work at each sample.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pin_nonideal.compilation.compiled_scene import CompiledScene
from pin_nonideal.compilation.contact_groups import Groups
from pin_nonideal.types import Array

LEDGER = ("kinetic", "potential", "total", "balance")  # columns of every energy ledger


def energy_ledger(works: Groups, columns: Sequence[str], energy: Array) -> dict[str, Array]:
    """Return the stored energies, the work since the start, and their sums.

    The balance is the total energy minus the total energy at the start and all work [J]: zero in exact
    mechanics.

    Args:
        works: works of the user, as groups of columns of the core.
        columns: names of these works and of the energy changes at impacts, if the scene has any.
        energy: the core's columns, kinetic and potential energy first [J], (n,).
    """
    stored, names = ("kinetic", "potential"), (*columns, "projection")
    split = len(stored)
    more = len(names) - len(works.names)
    numbers, last = energy.reshape(-1, split + works.count + more), split + works.count
    if not works.single:
        numbers = np.hstack([numbers[:, :split], works.sum(numbers[:, split:last]), numbers[:, last:]])
    ledger = dict(zip(stored, numbers.T[:split], strict=True))
    ledger["total"] = ledger["kinetic"] + ledger["potential"]
    ledger |= dict(zip(names, numbers.T[split:], strict=True))
    ledger["balance"] = ledger["total"] - ledger["total"][:1] - numbers[:, split:].sum(axis=1)
    return ledger


def power_columns(compiled: CompiledScene) -> list[str]:
    """Return the names of the power columns; laws are renamed if another ledger column has their name.

    Args:
        compiled: compiled scene of the run.
    """
    names = compiled.works.names
    first_law = len(names) - len(compiled.laws.names)
    used_names = {*LEDGER, *names[:first_law], "projection"}
    return names[:first_law] + [f"law {name}" if name in used_names else name for name in names[first_law:]]
