"""Texts about a run for the heading and the help dialog of a replay page."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from .frames import Motion

if TYPE_CHECKING:
    from pin_nonideal.trajectory.trajectory import Trajectory


def subtitle_of(run: Trajectory) -> str:
    """Return the numbers of joints, constraints and contacts of a run, and the bound of its violation.

    Args:
        run: a run.
    """
    model = run.scene.model
    contacts = sum(is_contact for _, _, is_contact in run.rows.values())
    constraints = len(run.rows) - contacts
    words = [_count(model.njoints - 1, "joint")]
    words += [_count(constraints, "constraint")] if constraints or not contacts else []
    words += [_count(contacts, "contact")] if contacts else []
    if run.rows:
        words.append(f"violation below {_rounded_up(float(np.max(run.violation)))}")
    return " · ".join(words)


def _count(count: int, word: str) -> str:
    return f"{count or 'no'} {word}{'' if count == 1 else 's'}"


def _rounded_up(value: float) -> str:
    """Return a value rounded up to two digits."""
    if not value > 0.0:
        return "1e-16"
    power = 10.0 ** (np.floor(np.log10(value)) - 1.0)
    return f"{np.ceil(value / power) * power:.1e}"


def facts_of(run: Trajectory, motion: Motion) -> list[tuple[str, str]]:
    """Return the data of a run for the help dialog.

    Args:
        run: a run.
        motion: motion of the run by frames.
    """
    model = run.scene.model
    frames = f"{len(motion.times)} frames"
    if motion.held.any():
        frames += f", {int(motion.held.sum())} of them still: samples too far apart"
    facts = [
        ("scene", str(run.scene.name)),
        ("model", f"{model.name}, {model.njoints - 1} joints, nq {model.nq}, nv {model.nv}"),
        ("time", f"{run.t[0]:g} to {run.t[-1]:g} s, {len(run.t)} samples, {frames}"),
    ]
    for key, value in vars(run.stats).items():
        facts.append((str(key), f"{value:g}" if isinstance(value, float) else str(value)))
    return [*facts, ("Pinocchio", str(pin.__version__))]
