"""Interpolation of a run between its samples: by the interpolants of its steps, or else by cubics."""

from __future__ import annotations

from collections.abc import Callable, ItemsView, Iterator, Mapping, ValuesView
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.scene.scene import compiled_scene
from pin_nonideal.trajectory.groups import Group
from pin_nonideal.types import Array

from .between_samples import Cubics
from .frames import MIN_FRAMES, Motion

if TYPE_CHECKING:
    from pin_nonideal.trajectory.trajectory import Trajectory

# Fields with values at the samples; the fields in `TABLE_FIELDS` are dictionaries by name.
SAMPLED_FIELDS = (
    "violation",
    "violation_rate",
    "a",
    "tau",
    "F_ideal",
    "F_nonideal",
    "lam",
    "lam_ideal",
    "limits",
    "z",
)
TABLE_FIELDS = ("energy", "power", "law_forces", "reactions", "contact_forces", "contact_torques")


def resample(run: Trajectory, motion: Motion) -> tuple[Trajectory, Motion]:
    """Return the run resampled at the frames of its replay if it has too few samples, else unchanged.

    With record "dense" all values come from the interpolants of the steps. Otherwise q and v follow the drawn
    cubic, kinetic and potential energy are computed from q and v, and all other values are linear between
    samples.

    Args:
        run: run of the replay.
        motion: motion of the run.
    """
    if len(run.t) >= MIN_FRAMES or len(motion.times) <= len(run.t):
        return run, motion
    inner = np.flatnonzero((motion.part > 0.0) & (motion.part < 1.0))
    dense = None
    if getattr(run, "dense", None) is not None and len(inner):
        dense = run.at(motion.times[inner])

    def at_frames(values: Array, exact: Array | None = None) -> Array:
        samples = motion.of(np.asarray(values, dtype=float))
        if exact is not None:
            samples[inner] = exact
        return samples

    values: dict[str, Any] = vars(run) | {
        "t": motion.times,
        "q": motion.q,
        "v": _velocities(run, motion, inner),
    }
    for key in SAMPLED_FIELDS:
        if run.recorded(key):
            values[key] = at_frames(getattr(run, key), None if dense is None else getattr(dense, key))
    for key in TABLE_FIELDS:
        parts = getattr(run, key, None)
        if parts is not None:
            values[key] = _ResampledFields(key, parts, getattr(dense, key, None) or {}, at_frames)
    points = getattr(run, "points", None)
    if points is not None:
        forces = (at_frames(x) for x in (points.loads, points.forces))
        values["points"] = points.samples(motion.before).with_forces(*forces)
    for key in ("modes", "closed"):  # constant from a sample to the next
        if run.recorded(key):
            values[key] = np.asarray(getattr(run, key))[motion.before]
    if dense is not None:
        values["v"][inner] = dense.v
    elif values.get("energy") and hasattr(run.scene, "energies"):
        runner, q, v = compiled_scene(run.scene).program.runner(), values["q"], values["v"]
        stored = np.array([runner.energies(q[k], v[k]) for k in inner]).reshape(-1, 2)
        every = zip(("kinetic", "potential", "total"), [*stored.T, stored.sum(axis=1)], strict=True)
        for name, energy in every:
            values["energy"][name][inner] = energy
    samples = type(run).__new__(type(run))  # not copied, because a copy drops a scene that cannot be pickled
    vars(samples).update(values)
    count = len(motion.times)
    return samples, replace(motion, before=np.arange(count), part=np.zeros(count))


class _ResampledFields(Group[Array]):
    """Values by name at the frames of a replay, each resampled when it is read first.

    Args:
        field: field of the Trajectory.
        samples: values at the samples of the run by name.
        exact: values at the frames between samples by name, where the interpolants of the steps are known.
        at_frames: function of both that returns the values at the frames.
    """

    def __init__(
        self,
        field: str,
        samples: Mapping[str, Array],
        exact: Mapping[str, Array],
        at_frames: Callable[..., Array],
    ) -> None:
        super().__init__(field, samples)
        self._exact, self._at_frames, self._left = exact, at_frames, set(samples)

    def __getitem__(self, name: str) -> Array:
        if name in self._left:
            self._left.remove(name)
            self[name] = self._at_frames(super().__getitem__(name), self._exact.get(name))
        return super().__getitem__(name)

    def __iter__(self) -> Iterator[str]:  # a dict with an iterator of its own is copied by its items
        return super().__iter__()

    def get(self, name: str, default: Array | None = None) -> Array | None:  # type: ignore[override]
        if name not in self:
            return default
        return self[name]

    def values(self) -> ValuesView[Array]:  # type: ignore[override]
        return ValuesView(self)

    def items(self) -> ItemsView[str, Array]:  # type: ignore[override]
        return ItemsView(self)


def _velocities(run: Trajectory, motion: Motion, inner: NDArray[np.intp]) -> Array:
    """Return the velocities of the cubic at frames between samples, else of the samples, (n, nv)."""
    velocities = motion.of(run.v)
    cubics = motion.cubics or Cubics(run)
    velocities[inner] = cubics.velocities(motion.before[inner], motion.part[inner])
    return velocities
