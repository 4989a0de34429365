"""Checkpoint: one file with the state of a run between two steps, for bitwise continuation.

The file is a NumPy archive without pickles: a header in JSON, and the core's state as bytes with their
digest. Reading it executes no code.
"""

from __future__ import annotations

import hashlib
import json
import os
import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from pin_nonideal.atomic_files import file_path, whole_file
from pin_nonideal.compilation.compiled_scene import CompiledScene
from pin_nonideal.compilation.delay import DelayedTorque
from pin_nonideal.compilation.lowering import lower
from pin_nonideal.compilation.resolver import Resolver
from pin_nonideal.compilation.sampled_control import initial_torque
from pin_nonideal.core_loader import core
from pin_nonideal.description.drive_kinds import delayed_control
from pin_nonideal.errors import InputError, LoadingError, OutputError
from pin_nonideal.scene.scene import Scene, compiled_scene, scene_origin
from pin_nonideal.trajectory.file import READ_ERRORS, reason_of
from pin_nonideal.types import Table
from pin_nonideal.validation import nonnegative
from pin_nonideal.version import __version__

from .options import RunOptions

FORMAT = 5
# Largest interval, longer than any run [s].
MAX_INTERVAL = 1e8


@dataclass(frozen=True)
class Checkpoint:
    """State and options of a run between two steps.

    Attributes:
        scene: name of the scene.
        origin: name and parameters for `load`, or None.
        fingerprint: digest of the scene, see `fingerprint`.
        options: checked options of the run.
        interval: wall time between checkpoints [s].
        wall_s: wall time so far [s].
        notes: notes on the start of the run.
        delayed: samples of a delayed control that have not acted yet, see `DelayedTorque.pending`.
        state: state of the core.
    """

    scene: str
    origin: Table | None
    fingerprint: str
    options: RunOptions
    interval: float
    wall_s: float
    notes: list[str]
    delayed: list[tuple[float, list[float]]]
    state: bytes


class Saver:
    """Writer of the checkpoints of one run.

    Args:
        path: the file.
        scene: the scene of the run.
        options: options of the run.
        interval: wall time between checkpoints [s].
        wall_s: wall time that earlier parts of the run took [s].
        notes: notes on the start of the run.
        delayed: delayed torques of the run, or None.

    Attributes:
        interval: wall time between checkpoints, bounded [s].
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        scene: Scene,
        options: RunOptions,
        interval: float,
        wall_s: float = 0.0,
        notes: Sequence[str] = (),
        delayed: DelayedTorque | None = None,
    ) -> None:
        self._delayed = delayed
        self._path = file_path("simulate: checkpoint", path)
        self._wall = wall_s - time.perf_counter()
        self._written = False
        self.interval = min(nonnegative("simulate: checkpoint_interval", interval), MAX_INTERVAL)
        self._header = {
            "format": FORMAT,
            "version": _version(),
            "scene": scene.name,
            "origin": scene_origin(scene).table,
            "fingerprint": fingerprint(compiled_scene(scene)),
            "options": {**vars(options), "atol": options.atol.tolist()},
            "interval": self.interval,
            "notes": list(notes),
        }

    def __call__(self, state: bytes) -> None:
        """Replace the file; if a later checkpoint cannot be written, warn and keep the last one.

        Raises:
            OutputError: the first checkpoint cannot be written.
        """
        wall = self._wall + time.perf_counter()
        header = {**self._header, "wall_s": wall, "digest": hashlib.sha256(state).hexdigest()}
        header["delayed"] = [] if self._delayed is None else self._delayed.pending
        arrays: Table = {
            "header": np.array(json.dumps(header)),
            "state": np.frombuffer(state, dtype=np.uint8),
        }
        try:
            with whole_file(self._path, "the checkpoint") as file:
                np.savez(file, **arrays)
        except OutputError as error:
            if not self._written:
                raise
            warnings.warn(
                f"{error}; the run continues, and the last checkpoint stays", RuntimeWarning, stacklevel=2
            )
        self._written = True


def read_checkpoint(path: Path) -> Checkpoint:
    """Read a checkpoint file.

    Args:
        path: the file.

    Raises:
        LoadingError: the file is missing, damaged, no checkpoint, or of another version of this package.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            header, state = json.loads(str(file["header"])), bytes(file["state"])
        if header["format"] != FORMAT or header["version"] != _version():
            raise LoadingError(
                f'"{path}" was written by another version of pin_nonideal; finish the run with that version, '
                "or start it again"
            )
        if hashlib.sha256(state).hexdigest() != header["digest"]:
            raise LoadingError(f'"{path}" is damaged: its state differs from the written state')
        held = header["options"]
        return Checkpoint(
            scene=header["scene"],
            origin=header["origin"],
            fingerprint=header["fingerprint"],
            options=RunOptions(**{**held, "atol": np.array(held["atol"], dtype=float)}),
            interval=float(header["interval"]),
            wall_s=float(header["wall_s"]),
            notes=[str(note) for note in header["notes"]],
            delayed=[(float(t), [float(x) for x in tau]) for t, tau in header.get("delayed", [])],
            state=state,
        )
    except LoadingError:
        raise
    except READ_ERRORS as error:
        raise LoadingError(
            f'cannot read a checkpoint from "{path}": {reason_of(error)}; '
            "it must be a file that simulate(..., checkpoint=path) wrote"
        ) from error


def _version() -> list[str]:
    """Return package version and state layout of the core; other versions may differ in the last bits."""
    return [__version__, core.state_layout]


def fingerprint(compiled: CompiledScene) -> str:
    """Return a digest of a compiled scene: model, rows, laws, forces and actuation as numbers.

    All user functions count as equal.

    Args:
        compiled: the compiled scene.
    """
    model, spec = compiled.model, compiled.spec
    digest = hashlib.sha256((model.saveToString() + spec.terms).encode())
    transcript: Any = _Transcript(core.Builder(model), digest)
    lower(spec, transcript, Resolver(model, compiled.q0))
    control = delayed_control(spec.actuation)
    if control is not None:  # the builder has no delay
        initial = initial_torque(control, model).tolist()
        digest.update(json.dumps([control.delay_in_samples, initial]).encode())
    return digest.hexdigest()


class _Transcript:
    """A proxy of the core's builder that computes a digest of its calls."""

    def __init__(self, builder: core.Builder, digest: Any) -> None:
        self._builder, self._digest = builder, digest

    def __getattr__(self, name: str) -> Any:
        method = getattr(self._builder, name)
        if not callable(method):
            return method

        def record(*arguments: object, **named: object) -> object:
            call = [name, _json_value(arguments), {key: _json_value(value) for key, value in named.items()}]
            self._digest.update(json.dumps(call).encode())
            return method(*arguments, **named)

        return record


def _json_value(x: object) -> object:
    """Convert arguments to JSON values; functions become a placeholder."""
    if isinstance(x, (list, tuple, np.ndarray)):
        return [_json_value(each) for each in x]
    if isinstance(x, np.generic):
        return x.item()
    if isinstance(x, Enum):
        return x.name
    return "a function" if callable(x) else x


def refuse_other_scene(held: Checkpoint, compiled: CompiledScene, name: str, path: Path) -> None:
    """Check that a scene is the scene of the checkpoint.

    Raises:
        InputError: model, rows, laws or forces differ.
    """
    if fingerprint(compiled) != held.fingerprint:
        raise InputError(
            f'resume: the scene must be the one that "{path}" was written with ("{held.scene}"); '
            f'"{name}" differs from it in its model, constraints, laws, contacts, forces or actuation'
        )
