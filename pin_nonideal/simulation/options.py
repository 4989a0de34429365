"""Options of a run: method, tolerances, durations and records, checked before the start."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pin_nonideal.compilation.compiled_scene import CompiledScene
from pin_nonideal.errors import InputError
from pin_nonideal.scene.evaluation import SEVERAL_CHOICES
from pin_nonideal.types import Array
from pin_nonideal.validation import array, choice, flag, nonnegative, number, positive

from .option_checks import (
    MIN_ATOL,
    check_clock,
    check_method,
    check_opening,
    record_groups,
    run_tolerance,
    step_lengths,
    step_limit,
    wall_limit,
)

DEFAULT_ATOL = 1e-10
MAX_CACHED = 32  # maximum number of cached options of a scene


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
        contact_points: whether all contact points are recorded.
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
    contact_points: bool
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
    compiled: CompiledScene,
    name: str,
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
        compiled: compiled scene to simulate.
        name: name of the scene, for messages.
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
    check_method(method, rtol, atol, dt)
    if opening := compiled.opening_names:
        check_opening(method, compiled.contact(opening[0]))
    nv = compiled.model.nv
    if nv == 0:
        raise InputError(f'simulate: "{name}" has no joint that moves; there is nothing to simulate')
    tolerance = np.full(2 * nv + compiled.program.states, DEFAULT_ATOL)
    if atol is not None:
        if np.asarray(atol, dtype=object).ndim == 0:
            tolerance[:] = nonnegative("simulate: atol", atol)
        else:
            tolerance[: 2 * nv] = array("simulate: atol", atol, (2 * nv,))
            tolerance[2 * nv :] = tolerance[: 2 * nv].min()
            if (tolerance < 0.0).any():
                raise InputError(f"simulate: atol must not be negative; got {tolerance.min():g}")
    relative = run_tolerance(rtol)
    if relative == 0.0 and not (tolerance > 0.0).all():
        raise InputError("simulate: rtol and atol must not both be zero; set one of them")
    begin, length = number("simulate: t0", t0), positive("simulate: duration", duration)
    lengths = step_lengths(dt, output_dt)
    if separate and output_dt is None:
        raise InputError(
            'simulate: events="separate" needs an output_dt: without one, every step is a sample'
        )
    check_clock(compiled.spec.actuation, begin, length, lengths)
    groups = record_groups(record)
    forces = bool(groups & {"forces", "contact_points"})
    return RunOptions(
        method=method,
        duration=length,
        t0=begin,
        rtol=relative,
        atol=np.ascontiguousarray(np.maximum(tolerance, MIN_ATOL)),
        dt=lengths.get("dt", 0.0),
        output_dt=lengths.get("output_dt", 0.0),
        max_steps=step_limit(max_steps),
        a="a" in groups or "reactions" in groups,  # wrenches of fixed joints need accelerations
        forces=forces,
        contact_points="contact_points" in groups,
        energy="energy" in groups,
        power="power" in groups,
        laws="laws" in groups or forces,
        reactions="reactions" in groups,
        tau="tau" in groups or forces,
        several=choice("simulate: several", several, SEVERAL_CHOICES),
        dense="dense" in groups,
        max_wall=wall_limit(max_wall),
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
    check_method(method, rtol, atol, dt)
    run_tolerance(rtol)
    step_lengths(dt, output_dt)
    record_groups(record)
    step_limit(max_steps)
    wall_limit(max_wall)
    number("simulate: t0", t0)
    positive("simulate: duration", duration)
    choice("simulate: several", several, SEVERAL_CHOICES)
    flag("simulate: strict", strict)


def cached_options(compiled: CompiledScene, *arguments: Any) -> RunOptions:
    """Return cached options of `run_options`; controllers often repeat the same run.

    Args:
        compiled: compiled scene to simulate, which holds the cache.
        *arguments: the other arguments of `run_options`, in order.
    """
    cache: dict[object, RunOptions] = compiled.__dict__.setdefault("_cached_options", {})
    key = (arguments, tuple(map(type, arguments)))  # types separate True from 1.0
    try:
        if key in cache:
            return cache[key]
    except TypeError:  # lists and arrays are mutable, so their options are not cached
        return run_options(compiled, *arguments)
    if len(cache) >= MAX_CACHED:
        cache.clear()
    cache[key] = options = run_options(compiled, *arguments)
    return options
