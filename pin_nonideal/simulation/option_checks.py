"""Checks of the options of a run, each by itself."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from pin_nonideal.description.drive_kinds import sampled_drives
from pin_nonideal.errors import InputError
from pin_nonideal.validation import choice, count, label, positive, relative_tolerance, sequence

from .methods import METHODS, SCIPY

RECORDS = ("a", "forces", "contact_points", "energy", "power", "laws", "reactions", "tau", "dense")
FIELDS = {"F_ideal": "forces", "F_nonideal": "forces", "lam": "forces", "lam_ideal": "forces"}
# Minimum length of a step in spacings of floating-point times. A shorter step has an error above one percent.
MIN_SPACINGS = 100.0
NO_LIMIT = 2**62  # steps of a run without limit
MAX_SAMPLES = 1e8  # some gigabytes for a small robot
MIN_ATOL = 1e-100  # smallest absolute tolerance: the square of error / atol must not overflow
DEFAULT_RTOL = 1e-8  # relative tolerance if `rtol` is None


def check_method(method: str, rtol: float | None, atol: ArrayLike | None, dt: float | None) -> None:
    """Check that a method exists and gets the options that it needs.

    Args:
        method: integration method.
        rtol: relative tolerance, or None.
        atol: absolute tolerance, or None.
        dt: step of the fixed-step methods [s], or None.

    Raises:
        InputError: see above.
    """
    choice("simulate: method", method, tuple(METHODS))
    if not METHODS[method]:
        if dt is None:
            raise InputError(f'simulate: method "{method}" needs a step dt')
        unused = [name for name, value in (("rtol", rtol), ("atol", atol)) if value is not None]
        if unused:
            raise InputError(
                f'simulate: method "{method}" takes steps of the length dt; leave {" and ".join(unused)} out'
            )
    elif dt is not None:
        raise InputError(f'simulate: method "{method}" chooses its own steps; leave dt out, or set output_dt')


def run_tolerance(rtol: float | None) -> float:
    """Return the relative tolerance, 0 for none.

    Args:
        rtol: relative tolerance, or None for the default.

    Raises:
        InputError: rtol is outside its bounds.
    """
    if rtol is None:
        return DEFAULT_RTOL
    return relative_tolerance("simulate: rtol", rtol)


def step_lengths(dt: float | None, output_dt: float | None) -> dict[str, float]:
    """Return the lengths of steps that are given [s], by name.

    Args:
        dt: step of the fixed-step methods [s], or None.
        output_dt: time between samples [s], or None.

    Raises:
        InputError: a length is not positive.
    """
    steps = {"dt": dt, "output_dt": output_dt}
    return {key: positive(f"simulate: {key}", value) for key, value in steps.items() if value is not None}


def record_groups(record: str | Sequence[str]) -> set[str]:
    """Return the groups of quantities to record.

    Args:
        record: names of quantities or of their groups.

    Raises:
        InputError: a name is unknown.
    """
    groups = set()
    for name in (record,) if isinstance(record, str) else sequence("simulate: record", record):
        group = FIELDS.get(name, name) if isinstance(name, str) else name
        groups.add(choice("simulate: record", group, RECORDS))
    return groups


def wall_limit(max_wall: float | None) -> float:
    """Return the maximum wall time [s] in the form of the core: 0 for no limit.

    Args:
        max_wall: maximum wall time [s], possibly infinite, or None.

    Raises:
        InputError: max_wall has another value.
    """
    if max_wall is None or (isinstance(max_wall, float) and max_wall == np.inf):
        return 0.0
    return positive("simulate: max_wall", max_wall)


def check_opening(method: str, name: str) -> None:
    """Check that the method supports unilateral contacts.

    Args:
        method: integration method.
        name: name of a contact that may open.

    Raises:
        InputError: the method does not support them.
    """
    known = [m for m in METHODS if m not in SCIPY]
    if method not in known:
        raise InputError(
            f'simulate: method "{method}" cannot open and close contacts, and "{name}" may open; use one of '
            f"{', '.join(known)}, with max_steps if the scene is stiff, or keep it closed "
            "with unilateral=False"
        )


def step_limit(max_steps: float | None) -> int:
    """Return the maximum number of steps in the form of the core: 0 for None, a huge number for infinity.

    Args:
        max_steps: a whole number of at least 1, infinity, or None.

    Raises:
        InputError: max_steps has another value.
    """
    if max_steps is None:
        return 0
    if isinstance(max_steps, float) and max_steps == np.inf:
        return NO_LIMIT
    whole = isinstance(max_steps, float) and max_steps.is_integer()
    return count(
        "simulate: max_steps", int(max_steps) if whole else max_steps, min_value=1, max_value=NO_LIMIT
    )


def check_clock(actuation: object, t0: float, duration: float, lengths: dict[str, float]) -> None:
    """Check that durations and steps are much longer than the spacing of floating-point times.

    Args:
        actuation: actuation of the scene.
        t0: initial time [s].
        duration: duration [s].
        lengths: dt and output_dt [s], if given.

    Raises:
        InputError: a length is too short, or the run would have too many samples.
    """
    end = max(abs(t0), abs(t0 + duration))
    spacing = float(np.spacing(end))
    named = {f"simulate: {key}": value for key, value in {"duration": duration, **lengths}.items()}
    controls = sampled_drives(actuation)
    for control in controls:
        named[f"{label(control)}: period"] = control.period
    for what, value in named.items():
        if not value >= MIN_SPACINGS * spacing:  # true for an infinite end as well
            raise InputError(
                f"{what} must be at least {MIN_SPACINGS:g} times the spacing of floating-point times, "
                f"which is {spacing:.2g} s at t = {end:g} s; got {value:g} s"
            )
    key = next((key for key in ("output_dt", "dt") if key in lengths), None)
    if key is not None and duration / lengths[key] > MAX_SAMPLES:
        raise InputError(
            f"simulate: {key} must leave at most {MAX_SAMPLES:g} samples; {lengths[key]:g} s leaves "
            f"{duration / lengths[key]:.2g}; set a longer {'output_dt' if key == 'dt' else key}"
        )
    for control in controls:
        if duration / control.period > MAX_SAMPLES:
            raise InputError(
                f"{label(control)}: period must leave at most {MAX_SAMPLES:g} calls in a run; "
                f"{control.period:g} s leaves {duration / control.period:.2g}; "
                "set a longer period"
            )
