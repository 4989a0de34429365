"""Files of trajectories: one NumPy archive without pickles, with a JSON header and an array per field."""

from __future__ import annotations

import json
import os
import tokenize
import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from pin_nonideal.atomic_files import file_path, mode_of, whole_file
from pin_nonideal.compilation.compiled_scene import CompiledScene
from pin_nonideal.errors import LoadingError, PinNonidealError
from pin_nonideal.loading.load import load_from_origin
from pin_nonideal.scene.scene import Scene, compiled_scene, scene_origin
from pin_nonideal.states.joint_layout import JointPlace
from pin_nonideal.types import Table

from .dense_output import DenseOutput
from .energy_ledger import LEDGER
from .fields import RunFields
from .missing_array import REASONS
from .npz import npz_bytes
from .point_samples import PointSamples
from .records import Event, Stats, UserEventRecord

FORMAT = 1
# Files up to this size [bytes] are compressed, in less than a tenth of a second. Compression of
# full-precision motions would save a tenth of the size and take ten to thirty times as long as writing.
MAX_COMPRESSED_BYTES = 1_000_000
# Errors of NumPy, zip archives and JSON for damaged files or files of another format.
READ_ERRORS: tuple[type[Exception], ...] = (OSError, ValueError, LookupError, TypeError, AttributeError)
READ_ERRORS += (EOFError, RuntimeError, tokenize.TokenError, zipfile.BadZipFile, zlib.error)
REQUIRED_FIELDS = ("t", "q", "v", "violation", "violation_rate")
OPTIONAL_FIELDS = (*REASONS, "z", "modes", "closed")
# Fields by name, with one row or number for each sample; a file has a table for each, or None.
GROUPS = ("energy", "power", "law_forces", "reactions", "contact_forces", "contact_torques")
TABLES = ("law_forces/", "reactions/", "contact_forces/", "contact_torques/", "points/")
DENSE_FIELDS = (
    *("times", "states", "modes", "closed", "turning", "directions", "sought", "torque", "moved"),
    "impacts",
)

LISTS = ("element_names", "element_laws", "law_names", "law_dofs")


def write(run: RunFields, path: str | os.PathLike[str]) -> Path:
    """Write all arrays of a Trajectory to one .npz file, completely or not at all.

    Args:
        run: trajectory of the run.
        path: file name; ".npz" is appended if it is missing.

    Returns:
        Path of the written file.

    Raises:
        InputError: `path` is not the name of a file.
        OutputError: the file cannot be written.
    """
    target = file_path("Trajectory.save: path", path)
    if target.suffix != ".npz":
        mode_of(target, "the trajectory")  # "/dev/null" must not become "/dev/null.npz"
        target = target.with_name(target.name + ".npz")
    arrays = _arrays(run)
    size = sum(np.asarray(x).nbytes for x in arrays.values())
    with whole_file(target, "the trajectory") as stream:
        (np.savez_compressed if size <= MAX_COMPRESSED_BYTES else np.savez)(stream, **arrays)
    return target


def to_bytes(run: RunFields) -> bytes:
    """Return the content of the file that `write` writes, without compression, for a large number of runs.

    Args:
        run: trajectory of the run.
    """
    arrays = _arrays(run)
    arrays["header"] = np.array(str(arrays["header"]).encode())  # JSON in ASCII needs a quarter of the space
    return npz_bytes(arrays)


def _arrays(run: RunFields) -> Table:
    """Return all arrays of a trajectory and its header, by their names in a file."""
    arrays: Table = {key: getattr(run, key) for key in REQUIRED_FIELDS}
    arrays |= {key: getattr(run, key) for key in OPTIONAL_FIELDS if run.recorded(key)}
    if run.closed is not None:
        arrays["closed"] = run.closed.astype(np.int8)
    tables = {group: vars(run)[group] for group in GROUPS}
    for group, table in tables.items():
        arrays |= {f"{group}/{i}": x for i, x in enumerate((table or {}).values())}
    if run.points is not None:
        for key, x in run.points.arrays().items():
            arrays[f"points/{key}"] = x.astype(np.int8) if x.dtype == bool else x
    header = {
        "format": FORMAT,
        "name": run.name,
        "notes": run.notes,
        "failure": run.failure,
        "events": [_event_list(e) for e in run.events],
        "stats": vars(run.stats),
        "origin": None if run.scene is None else scene_origin(run.scene).table,
    }
    header |= {key: getattr(run, key) for key in (*LISTS, "joints", "rows")}
    header |= {group: None if table is None else list(table) for group, table in tables.items()}
    if run.points is not None:
        header["points"] = [run.points.names, run.points.contacts]
    arrays |= {f"loose/{key}": x for key, x in _extra_arrays(run).items()}
    header["user_events"] = [record.name for record in run.user_events]
    if run.dense is not None:
        options = vars(run.dense.options)
        header["dense"] = {**options, "atol": options["atol"].tolist()}
    arrays["header"] = np.array(json.dumps(header))
    return arrays


def read(path: str | os.PathLike[str]) -> tuple[Table, Table | None]:
    """Return the fields of the Trajectory in a file, and the origin of its scene; no content is executed.

    Args:
        path: file name.

    Raises:
        InputError: `path` is not the name of a file.
        LoadingError: the file is missing, truncated, or not a trajectory.
    """
    source = file_path("Trajectory.load: path", path)
    return read_from(source, source)


def read_from(stream: Any, source: Path) -> tuple[Table, Table | None]:
    """Return the fields and the origin of the scene from an open file; see `read`.

    Args:
        stream: open file, or file name.
        source: file name, for messages.

    Raises:
        LoadingError: the file is truncated, or not a trajectory.
    """
    try:
        with np.load(stream, allow_pickle=False) as file:
            arrays = {key: file[key] for key in file.files}
        header = json.loads(arrays.pop("header").item())
        if header.get("format") != FORMAT:
            raise LoadingError(f'"{source}" must have format {FORMAT}; it has {header.get("format")}')
        missing = [key for key in REQUIRED_FIELDS if key not in arrays]
        if missing:
            raise LoadingError(f'"{source}" is no complete trajectory: {", ".join(missing)} missing')
        loose = {key: arrays.pop(key) for key in list(arrays) if key.startswith("loose/")}
        _check_arrays(arrays, source)
        fields: Table = {key: arrays.get(key) for key in (*REQUIRED_FIELDS, *OPTIONAL_FIELDS)}
        for group in GROUPS:
            if header.get(group) is not None:  # files of earlier versions have fewer groups
                if group == "energy":
                    _check_ledger(header[group], source)
                fields[group] = {name: arrays[f"{group}/{i}"] for i, name in enumerate(header[group])}
        if header.get("points") is not None:
            fields["points"] = points = _points(arrays, *header["points"])
            fields["contact_points"] = points.by_contact()
        fields |= {key: list(header.get(key, ())) for key in LISTS}
        events = [_event(*each) for each in header["events"]]
        if fields["closed"] is not None:
            fields["closed"] = fields["closed"].astype(bool)
        fields["joints"] = [
            JointPlace(str(n), str(k), *map(int, at)) for n, k, *at in header.get("joints", ())
        ]
        fields["rows"] = {
            str(n): (int(first), int(end), bool(c)) for n, (first, end, c) in header.get("rows", {}).items()
        }
        result = {
            **fields,
            **_extra_fields(loose, header, len(arrays["t"])),
            "events": events,
            "stats": Stats(**header["stats"]),
            "name": str(header["name"]),
            "notes": [str(note) for note in header.get("notes", [])],
            "failure": None if header.get("failure") is None else str(header["failure"]),
        }
        return result, header.get("origin")
    except LoadingError:
        raise
    except READ_ERRORS as error:
        raise LoadingError(
            f'cannot read a trajectory from "{source}": {reason_of(error)}; '
            "it must be an .npz file written by Trajectory.save"
        ) from error


def _points(arrays: Table, names: list[str], contacts: list[str]) -> PointSamples:
    """Return the samples of contact points in a file; invalid arrays raise one of `READ_ERRORS`."""
    point_arrays = {key.removeprefix("points/"): x for key, x in arrays.items() if key.startswith("points/")}
    point_arrays["closed"] = point_arrays["closed"].astype(bool)
    if any(x.shape[1] not in (0, len(names)) for x in point_arrays.values()) or len(names) != len(contacts):
        raise ValueError("contact points do not fit together")
    return PointSamples([str(n) for n in names], [str(n) for n in contacts], **point_arrays)


def reason_of(error: Exception) -> str:
    """Return the reason for an unreadable file, without the terms of NumPy, zip archives and JSON.

    Args:
        error: one of `READ_ERRORS`.
    """
    if isinstance(error, FileNotFoundError):
        return "there is no such file"
    if isinstance(error, IsADirectoryError):
        return "it is a folder"
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return "its content is damaged or of another kind"


def matches_scene(compiled: CompiledScene, joints: Sequence[JointPlace], rows: Table) -> bool:
    """Check if a scene has the joints and rows of a run.

    Args:
        compiled: compiled scene to compare.
        joints: joints of the run.
        rows: rows of the run.
    """
    return compiled.joints == list(joints) and compiled.rows == rows


def describe_content(joints: Sequence[JointPlace], rows: Table) -> str:
    """Return the joints, constraints and contacts of a run as text.

    Args:
        joints: joints of the run.
        rows: rows of the run.
    """
    named = [place.name for place in joints]
    return f"the joints {_first_names(named)} and " + (
        f"the rows of {_first_names(list(rows))}" if rows else "no rows"
    )


def _first_names(names: Sequence[str]) -> str:
    return ", ".join(f'"{name}"' for name in names[:4]) + (", ..." if len(names) > 4 else "")


def reload_scene(origin: Any, joints: Sequence[JointPlace], rows: Table, notes: list[str]) -> Scene | None:
    """Reload the scene of a saved run; return None and add a note if the scene is missing or has changed.

    Args:
        origin: name and parameters of `load`, or None.
        joints: joints of the run.
        rows: rows of the run.
        notes: notes of the run; may grow.
    """
    if origin is None:
        return None
    try:
        scene = load_from_origin(origin)
    except (PinNonidealError, OSError, ValueError, LookupError, TypeError, AttributeError) as error:
        notes.append(f"the scene of the run cannot be loaded again: {error}")
        return None
    if matches_scene(compiled_scene(scene), joints, rows):
        return scene
    notes.append(f'the robot "{origin["name"]}" is no longer the one of the run; its scene is left out')
    return None


def _event_list(e: Event) -> list[Any]:
    """Return an event as a list for the header of a file."""
    if e.kind == "relaxed":
        return [e.time, e.kind, e.element, e.miss]
    if e.impulse is None or e.v_minus is None or e.v_plus is None:
        return [e.time, e.kind, e.element]
    vectors = [x.tolist() for x in (e.impulse, e.v_minus, e.v_plus)]
    return [e.time, e.kind, e.element, e.energy_change, *vectors]


def _event(t: float, kind: str, element: str, change: float = 0.0, *vectors: Sequence[float]) -> Event:
    """Return an event from its list in the header of a file."""
    if not vectors:
        return Event(float(t), str(kind), str(element), miss=float(change))
    impulse, before, after = (np.array(x, dtype=float) for x in vectors)
    return Event(float(t), str(kind), str(element), impulse, float(change), before, after)


def _extra_arrays(run: RunFields) -> Table:
    """Return the arrays without a row for each sample, by name."""
    arrays: Table = {} if run.grid is None else {"grid": run.grid.astype(np.int8)}
    for k, record in enumerate(run.user_events):
        arrays |= {f"event/{k}/{key}": getattr(record, key) for key in ("t", "q", "v")}
    if run.dense is not None:
        arrays |= {f"dense/{key}": getattr(run.dense, key) for key in DENSE_FIELDS}
    return arrays


def _extra_fields(loose: Table, header: Table, samples: int) -> Table:
    """Return the fields that consist of such arrays; invalid arrays raise one of `READ_ERRORS`."""
    fields: Table = {}
    if "loose/grid" in loose:
        fields["grid"] = loose["loose/grid"].astype(bool).reshape(samples)
    fields["user_events"] = [
        UserEventRecord(str(name), *(loose[f"loose/event/{k}/{key}"] for key in ("t", "q", "v")))
        for k, name in enumerate(header.get("user_events", ()))
    ]
    if "dense" in header:
        options = SimpleNamespace(**header["dense"])
        options.atol = np.array(options.atol, dtype=float)
        found = [key for key in DENSE_FIELDS if f"loose/dense/{key}" in loose]
        dense = {key: loose[f"loose/dense/{key}"] for key in found}
        fields["dense"] = DenseOutput(**_completed(dense), options=options)
        fields["dense"].check()
    return fields


def _completed(dense: Table) -> Table:
    """Return the arrays of dense output with those that files of earlier versions lack."""
    steps, elements = dense["modes"].shape
    if "sought" not in dense:  # the directions are those at the end of each step
        points = dense["states"].shape[1]
        dense["directions"] = np.repeat(dense["directions"][:, None], points, axis=1)
        dense["sought"] = np.zeros_like(dense["modes"])
    earlier: Table = {}
    if "closed" not in dense:
        several = elements if dense["directions"].shape[2] else 0
        earlier["closed"] = np.zeros((steps, 0), np.int8)
        earlier["turning"] = np.arange(several)
        earlier["impacts"] = np.zeros((steps, 2))
    return earlier | dense


def _check_ledger(names: Sequence[str], source: Path) -> None:
    """Check that the energy ledger has its required columns.

    Raises:
        LoadingError: a column is missing.
    """
    missing = [name for name in LEDGER if name not in names]
    if missing:
        raise LoadingError(f'"{source}" is no trajectory: its energy has no {", ".join(missing)}')


def _check_arrays(arrays: Table, source: Path) -> None:
    """Check that every array holds numbers and has a row for each sample.

    Raises:
        LoadingError: an array is invalid.
    """
    rows = arrays["t"].shape[:1]
    t = arrays["t"]
    if t.dtype.kind in "fi" and t.ndim == 1:
        if not np.isfinite(t).all():
            raise LoadingError(
                f'"{source}" is no trajectory: t must be finite; it holds {t[~np.isfinite(t)][0]}'
            )
        early = np.flatnonzero(np.diff(t) < 0.0)
        if early.size:
            i = int(early[0])
            raise LoadingError(
                f'"{source}" is no trajectory: t must not fall; t[{i + 1}] = {t[i + 1]:g} follows {t[i]:g}'
            )
    for key, x in arrays.items():
        if x.dtype.kind not in "fi":
            raise LoadingError(f'"{source}" is no trajectory: {key} must hold numbers; got {x.dtype.name}')
        if key in ("q", "v") and not np.isfinite(x).all():
            raise LoadingError(
                f'"{source}" is no trajectory: {key} must be finite; it holds {x[~np.isfinite(x)][0]}'
            )
        is_table = key.startswith(TABLES)
        columns = 2 if is_table or key in ("q", "v", *OPTIONAL_FIELDS) else 1
        columns = 3 if key in ("points/forces", "points/places") else columns
        if x.ndim != columns:
            shape = {1: "one column", 2: "a table", 3: "a table of vectors"}[columns]
            raise LoadingError(f'"{source}" is no trajectory: {key} must be {shape}; got shape {x.shape}')
        if x.shape[:1] != rows:
            raise LoadingError(
                f'"{source}" is no trajectory: {key} must have {rows[0]} rows as t has; got shape {x.shape}'
            )
