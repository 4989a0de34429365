"""Options of a run: method, tolerances, durations and records, checked before the start."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pin_nonideal.core_loader import core
from pin_nonideal.description.actuation import sampled_drives
from pin_nonideal.errors import InputError
from pin_nonideal.scene.evaluation import SEVERAL_CHOICES
from pin_nonideal.scene.scene import Scene, compiled_scene
from pin_nonideal.types import Array
from pin_nonideal.validation import array, choice, count, flag, label, nonnegative, number, positive, sequence

# Integration methods by name, with a flag for adaptive steps.
METHODS = {method.name: method.adaptive for method in core.methods()}
# Methods of SciPy, and its one-step methods, which can continue from a projected state.
SCIPY = tuple(method.name for method in core.methods() if method.outside)
ONE_STEP = tuple(method.name for method in core.methods() if method.outside and method.one_step)
RECORDS = ("a", "forces", "energy", "power", "laws", "reactions", "tau", "dense")
FIELDS = {"F_ideal": "forces", "F_nonideal": "forces", "lam": "forces", "lam_ideal": "forces"}
DEFAULT_RTOL, DEFAULT_ATOL = 1e-8, 1e-10
# Minimum length of a step in spacings of floating-point times. A shorter step has an error above one percent.
MIN_SPACINGS = 100.0
NO_LIMIT = 2**62  # steps of a run without limit
MAX_CACHED = 32  # maximum number of cached options of a scene
MAX_SAMPLES = 1e8  # some gigabytes for a small robot
# Smallest tolerances: no step meets rtol below rounding, and the square of error / atol must not overflow.
MIN_RTOL, MIN_ATOL = 1e-14, 1e-100
# Largest relative tolerance: a step that changes a coordinate by more than a tenth of it follows nothing.
MAX_RTOL = 0.1


@dataclass(frozen=True, eq=False)
class RunOptions:
    """Options of a run, in the form that the core and checkpoints read.

    Attributes:
        method: integration method.
        duration: duration [s].
        t0: initial time [s].
        rtol: relative tolerance.
        atol: absolute tolerances of positions, velocities and states of laws, (2 nv + nz,).
        dt: step of the fixed-step methods [s], or 0.
        output_dt: time between samples [s], or 0 for every accepted step.
        max_steps: maximum number of accepted steps, or 0 for no limit except in a stiff scene.
        a: whether accelerations are recorded.
        forces: whether forces and multipliers are recorded.
        energy: whether the energy ledger is recorded.
        power: whether powers are recorded.
        laws: whether the forces of each law and the friction limits are recorded.
        reactions: whether the reaction wrenches of joints and anchors are recorded.
        tau: whether torques of the actuation are recorded.
        dense: whether interpolants of the steps are recorded.
        max_wall: maximum wall time [s], or 0 for no limit.
        event_names: names of the user's event functions.
        separate: whether samples lie on the output grid only.
        several: "error" or "continue" if the laws admit several motions.
        strict: whether an impact that gains energy is an error.
    """

    method: str
    duration: float
    t0: float
    rtol: float
    atol: Array
    dt: float
    output_dt: float
    max_steps: int
    a: bool
    forces: bool
    energy: bool
    power: bool
    laws: bool
    reactions: bool
    tau: bool
    dense: bool
    max_wall: float
    event_names: tuple[str, ...]
    separate: bool
    several: str
    strict: bool


def run_options(
    scene: Scene,
    duration: float,
    t0: float,
    method: str,
    rtol: float | None,
    atol: ArrayLike | None,
    dt: float | None,
    output_dt: float | None,
    max_steps: float | None,
    record: str | Sequence[str],
    several: str,
    max_wall: float | None = None,
    event_names: tuple[str, ...] = (),
    separate: bool = False,
    strict: bool = False,
) -> RunOptions:
    """Return the checked options of a run.

    Args:
        scene: scene to simulate.
        duration: duration [s].
        t0: initial time [s].
        method: integration method.
        rtol: relative tolerance, or None.
        atol: absolute tolerance, a number or an array (2 nv,), or None.
        dt: step of the fixed-step methods [s], or None.
        output_dt: time between samples [s], or None.
        max_steps: maximum number of accepted steps, possibly infinite, or None.
        record: names of quantities to record.
        several: "error" or "continue".
        max_wall: maximum wall time [s], possibly infinite, or None.
        event_names: names of the user's event functions.
        separate: whether samples lie on the output grid only.
        strict: whether an impact that gains energy is an error.

    Raises:
        InputError: an option is invalid, or two options exclude each other.
    """
    _check_method(method, rtol, atol, dt)
    if opening := compiled_scene(scene).opening_names:
        _check_opening(method, record, opening[0])
    nv = scene.model.nv
    if nv == 0:
        raise InputError(f'simulate: "{scene.name}" has no joint that moves; there is nothing to simulate')
    tolerance = np.full(2 * nv + compiled_scene(scene).program.states, DEFAULT_ATOL)
    if atol is not None:
        if np.asarray(atol, dtype=object).ndim == 0:
            tolerance[:] = nonnegative("simulate: atol", atol)
        else:
            tolerance[: 2 * nv] = array("simulate: atol", atol, (2 * nv,))
            tolerance[2 * nv :] = tolerance[: 2 * nv].min()
            if (tolerance < 0.0).any():
                raise InputError(f"simulate: atol must not be negative; got {tolerance.min():g}")
    relative = _relative(rtol)
    if relative == 0.0 and not (tolerance > 0.0).all():
        raise InputError("simulate: rtol and atol must not both be zero; set one of them")
    begin, length = number("simulate: t0", t0), positive("simulate: duration", duration)
    lengths = _lengths(dt, output_dt)
    if separate and output_dt is None:
        raise InputError(
            'simulate: events="separate" needs an output_dt: without one, every step is a sample'
        )
    _check_clock(scene, begin, length, lengths)
    groups = _groups(record)
    return RunOptions(
        method=method,
        duration=length,
        t0=begin,
        rtol=relative,
        atol=np.ascontiguousarray(np.maximum(tolerance, MIN_ATOL)),
        dt=lengths.get("dt", 0.0),
        output_dt=lengths.get("output_dt", 0.0),
        max_steps=_most_steps(max_steps),
        a="a" in groups or "reactions" in groups,  # wrenches of fixed joints need accelerations
        forces="forces" in groups,
        energy="energy" in groups,
        power="power" in groups,
        laws="laws" in groups or "forces" in groups,
        reactions="reactions" in groups,
        tau="tau" in groups or "forces" in groups,
        several=choice("simulate: several", several, SEVERAL_CHOICES),
        dense="dense" in groups,
        max_wall=_most_wall(max_wall),
        event_names=event_names,
        separate=separate,
        strict=flag("simulate: strict", strict),
    )


def check_values(
    duration: float,
    *,
    t0: float = 0.0,
    method: str = "dop853",
    rtol: float | None = None,
    atol: ArrayLike | None = None,
    dt: float | None = None,
    output_dt: float | None = None,
    max_steps: float | None = None,
    max_wall: float | None = None,
    record: str | Sequence[str] = (),
    several: str = "error",
    strict: bool = False,
    **others: object,
) -> None:
    """Check the options of `simulate` that do not depend on the scene.

    Args:
        duration: duration [s].
        t0: initial time [s].
        method: integration method.
        rtol: relative tolerance, or None.
        atol: absolute tolerance, or None.
        dt: step of the fixed-step methods [s], or None.
        output_dt: time between samples [s], or None.
        max_steps: maximum number of accepted steps, or None.
        max_wall: maximum wall time [s], or None.
        record: names of quantities to record.
        several: "error" or "continue".
        strict: whether an impact that gains energy is an error.
        others: further options, which are not checked.

    Raises:
        InputError: an option is invalid, or two options exclude each other.
    """
    del others
    _check_method(method, rtol, atol, dt)
    _relative(rtol)
    _lengths(dt, output_dt)
    _groups(record)
    _most_steps(max_steps)
    _most_wall(max_wall)
    number("simulate: t0", t0)
    positive("simulate: duration", duration)
    choice("simulate: several", several, SEVERAL_CHOICES)
    flag("simulate: strict", strict)


def cached_options(scene: Scene, *arguments: Any) -> RunOptions:
    """Return cached options of `run_options`; controllers often repeat the same run.

    Args:
        scene: scene to simulate, which holds the cache.
        *arguments: the other arguments of `run_options`, in order.
    """
    cache: dict[object, RunOptions] = scene.__dict__.setdefault("_cached_options", {})
    key = (arguments, tuple(map(type, arguments)))  # types separate True from 1.0
    try:
        if key in cache:
            return cache[key]
    except TypeError:  # lists and arrays are mutable, so their options are not cached
        return run_options(scene, *arguments)
    if len(cache) >= MAX_CACHED:
        cache.clear()
    cache[key] = options = run_options(scene, *arguments)
    return options


def _check_method(method: str, rtol: float | None, atol: ArrayLike | None, dt: float | None) -> None:
    """Check that a method exists and gets the options that it needs.

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


def _relative(rtol: float | None) -> float:
    """Return the relative tolerance, 0 for none.

    Raises:
        InputError: rtol is outside its bounds.
    """
    if rtol is None:
        return DEFAULT_RTOL
    relative = nonnegative("simulate: rtol", rtol)
    if relative and not MIN_RTOL <= relative <= MAX_RTOL:
        raise InputError(
            f"simulate: rtol must be from {MIN_RTOL:g} (rounding) to {MAX_RTOL:g}, or zero for atol alone"
            f"; got {relative:g}"
        )
    return relative


def _lengths(dt: float | None, output_dt: float | None) -> dict[str, float]:
    """Return the lengths of steps that are given [s], by name."""
    steps = {"dt": dt, "output_dt": output_dt}
    return {key: positive(f"simulate: {key}", value) for key, value in steps.items() if value is not None}


def _groups(record: str | Sequence[str]) -> set[str]:
    """Return the groups of quantities to record.

    Raises:
        InputError: a name is unknown.
    """
    groups = set()
    for name in (record,) if isinstance(record, str) else sequence("simulate: record", record):
        group = FIELDS.get(name, name) if isinstance(name, str) else name
        groups.add(choice("simulate: record", group, RECORDS))
    return groups


def _most_wall(max_wall: float | None) -> float:
    """Return the maximum wall time [s] in the form of the core: 0 for no limit.

    Raises:
        InputError: max_wall has another value.
    """
    if max_wall is None or (isinstance(max_wall, float) and max_wall == np.inf):
        return 0.0
    return positive("simulate: max_wall", max_wall)


def _check_opening(method: str, record: str | Sequence[str], name: str) -> None:
    """Check that method and records support unilateral contacts.

    Raises:
        InputError: the method or a record does not support them.
    """
    if "dense" in ((record,) if isinstance(record, str) else record):
        raise InputError(
            f'simulate: record "dense" knows no contacts that open, and "{name}" may open; leave it out, or '
            "keep the contact closed with unilateral=False"
        )
    known = [m for m in METHODS if m not in SCIPY]
    if method not in known:
        raise InputError(
            f'simulate: method "{method}" cannot open and close contacts, and "{name}" may open; use one of '
            f"{', '.join(known)}, with max_steps where one of them calls the scene stiff, or keep it closed "
            "with unilateral=False"
        )


def _most_steps(max_steps: float | None) -> int:
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


def _check_clock(scene: Scene, t0: float, duration: float, lengths: dict[str, float]) -> None:
    """Check that durations and steps are much longer than the spacing of floating-point times.

    Args:
        scene: scene to simulate.
        t0: initial time [s].
        duration: duration [s].
        lengths: dt and output_dt [s], if given.

    Raises:
        InputError: a length is too short, or the run would have too many samples.
    """
    end = max(abs(t0), abs(t0 + duration))
    spacing = float(np.spacing(end))
    named = {f"simulate: {key}": value for key, value in {"duration": duration, **lengths}.items()}
    controls = sampled_drives(scene.actuation)
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
