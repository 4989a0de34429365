"""Runs of a sweep in a folder: files of runs, and an index with the result of each run."""

from __future__ import annotations

import hashlib
import io
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from pin_nonideal.atomic_files import file_path
from pin_nonideal.errors import InputError, LoadingError, OutputError, RunError, short_repr
from pin_nonideal.html_tables import table
from pin_nonideal.scene.scene import Scene
from pin_nonideal.trajectory.file import read_from, reason_of
from pin_nonideal.trajectory.trajectory import Trajectory, restore_trajectory
from pin_nonideal.types import Table

from .pack import SUFFIX, read_archive, read_records

FORMAT = 2
ROWS_SHOWN = 20  # runs in the table of a notebook
QUANTILES = (0.0, 0.05, 0.25, 0.5, 0.75, 0.95, 1.0)


class Sweep(Sequence[Trajectory]):
    """Runs of a sweep in a folder; each run is read from its file on access.

    Args:
        folder: folder that `sweep(..., store=folder)` filled.

    Attributes:
        folder: path of the folder.
        records: entry of each run, in order, or None for a missing run. The keys are `parameters`, `error`
            (the message of the error that stopped the run, or None), `t_end`, `steps`, `evaluations`,
            `violation` (maximum over the run), `wall_s`, and the results of `measure`.

    Raises:
        LoadingError: the folder holds no sweep.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = file_path("Sweep: folder", folder)
        try:
            with (self.folder / "index.jsonl").open(encoding="utf-8") as lines:
                self._header = json.loads(next(lines))
                if self._header["format"] != FORMAT:
                    raise LoadingError(
                        f'"{self.folder}" holds no sweep of this version: its format is '
                        f"{short_repr(self._header['format'])} instead of {FORMAT}; finish it with the "
                        "version that began it"
                    )
                self.records: list[Table | None] = [None] * int(self._header["runs"])
                self._places: list[tuple[str, int, int] | None] = [None] * len(self.records)
                for line in lines:
                    if line.endswith("\n"):  # complete: no kill truncated the line
                        self._add_record(json.loads(line))
            self._unindexed = list(self._unindexed_runs())
        except LoadingError:
            raise
        except (OSError, ValueError, LookupError, TypeError, StopIteration) as error:
            absent = isinstance(error, FileNotFoundError)
            reason = "there is no index.jsonl in it" if absent else reason_of(error)
            raise LoadingError(
                f'"{self.folder}" holds no sweep: {reason}; it must be a folder that '
                "sweep(..., store=folder) made"
            ) from error

    def _add_record(self, record: Table) -> None:
        name, at, size = record.pop("at")
        k = record.pop("run")
        self.records[k], self._places[k] = record, (str(name), int(at), int(size))

    def _unindexed_runs(self) -> Iterator[Table]:
        """Yield runs that were written before a kill but are missing in the index."""
        ends: dict[str, int] = {}
        for place in self._places:
            if place is not None:
                ends[place[0]] = max(ends.get(place[0], 0), place[1] + place[2])
        for entry in sorted(os.scandir(self.folder), key=lambda each: each.name):
            if entry.name.endswith(SUFFIX) and entry.stat().st_size > ends.get(entry.name, 0):
                for record in read_records(Path(entry.path), ends.get(entry.name, 0)):
                    self._add_record(dict(record))
                    yield record

    def __len__(self) -> int:
        return len(self.records)

    def __getitem__(self, k: Any) -> Any:
        if isinstance(k, slice):
            return [self[i] for i in range(*k.indices(len(self)))]
        return self.load(k, scene=None)

    def load(self, k: int, scene: Scene | str | None = "source") -> Trajectory:
        """Return one run, with its scene if the scene is available.

        Args:
            k: number of the run.
            scene: scene of the run, as in `Trajectory.load`.

        Raises:
            InputError: the scene is not the scene of the run.
            LoadingError: the run is missing, failed before its first sample, or its file is damaged.
        """
        k = range(len(self))[k]
        record, place = self.records[k], self._places[k]
        if record is None or place is None:
            raise LoadingError(f"run {k} of the {self} is not done; the same call of sweep does it")
        if place[2] == 0:
            raise LoadingError(f"run {k} of the {self} has no samples; it failed: {record['error']}")
        path = self.folder / place[0]
        try:
            content = read_archive(self.folder, place)
        except OSError as error:
            raise LoadingError(f'cannot read run {k} from "{path}": {error.strerror or error}') from error
        return restore_trajectory(*read_from(io.BytesIO(content), path), path, scene)

    def __iter__(self) -> Iterator[Trajectory]:
        return (self[k] for k in range(len(self)))

    def __str__(self) -> str:
        complete = len(self) - len(self.missing)
        return f"sweep in {self.folder}: {complete} of {len(self)} runs, {len(self.failures)} of them failed"

    def _repr_html_(self) -> str:
        numbers = ("t_end", "steps", "violation", "wall_s")
        rows: list[list[object]] = []
        for k, record in enumerate(self.records[:ROWS_SHOWN]):
            if record is None:
                rows.append([k, "", "missing"])
                continue
            settings = ", ".join(f"{name}={short_repr(x)}" for name, x in record["parameters"].items())
            shown = [f"{record[key]:.6g}" if record.get(key) is not None else "" for key in numbers]
            rows.append([k, settings, record["error"] or "done", *shown])
        if len(self) > ROWS_SHOWN:
            rows.append(["...", f"{len(self) - ROWS_SHOWN} more", ""])
        title = str(self)
        return table(title[0].upper() + title[1:], rows, ("run", "parameters", "outcome", *numbers))

    @property
    def missing(self) -> list[int]:
        """Return the numbers of the runs that are not complete."""
        return [k for k, record in enumerate(self.records) if record is None]

    @property
    def failures(self) -> dict[int, str]:
        """Return the error messages of the failed runs, by number of the run."""
        return {k: r["error"] for k, r in enumerate(self.records) if r is not None and r["error"] is not None}

    def summary(self) -> Table:
        """Return mean, deviation and quantiles of each number over all complete runs, from the index alone.

        Returns:
            By name of the number ("violation", "steps", ..., and the results of `measure`): "mean", "std",
            "count", "quantiles" (by level) and "worst" (the run with the largest value).
        """
        complete = [(k, r) for k, r in enumerate(self.records) if r is not None]
        names = sorted({key for _, r in complete for key, x in r.items() if isinstance(x, (int, float))})
        statistics: Table = {}
        for name in names:
            runs, values = zip(
                *((k, r[name]) for k, r in complete if isinstance(r.get(name), (int, float))), strict=True
            )
            x = np.array(values, dtype=float)
            levels = {level: float(np.quantile(x, level)) for level in QUANTILES}
            worst = int(runs[int(np.argmax(x))])
            statistics[name] = {"mean": float(x.mean()), "std": float(x.std()), "count": len(x)}
            statistics[name] |= {"quantiles": levels, "worst": worst}
        return statistics


def open_store(folder: Path, digest: str, runs: int) -> list[int]:
    """Start or continue a sweep in a folder, and return the numbers of the missing runs.

    Args:
        folder: folder of the sweep.
        digest: digest of all inputs of the sweep.
        runs: number of runs.

    Raises:
        InputError: the folder holds another sweep.
        OutputError: the folder cannot be written.
    """
    index = folder / "index.jsonl"
    if folder.exists() and not folder.is_dir():
        raise OutputError(f'cannot write the sweep to "{folder}": it is a file; name a folder')
    if index.exists():
        held = Sweep(folder)
        if held._header.get("digest") != digest or held._header.get("format") != FORMAT:
            raise InputError(
                f'sweep: store "{folder}" holds another sweep: its parameters, duration or options differ; '
                "name another folder"
            )
        if held._unindexed:
            append_records(folder, held._unindexed)
        return held.missing
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()):
            raise InputError(
                f'sweep: store "{folder}" must be empty or hold this sweep; it holds other files'
            )
        header = {"format": FORMAT, "digest": digest, "runs": runs}
        index.write_text(json.dumps(header) + "\n", encoding="utf-8")
    except OSError as error:
        raise OutputError(f'cannot write the sweep to "{folder}": {error.strerror or error}') from error
    return list(range(runs))


def append_records(folder: Path, records: Sequence[Table]) -> None:
    """Append the results of some runs to the index.

    Args:
        folder: folder of the sweep.
        records: entries of the runs, each with the number of the run as "run".

    Raises:
        OutputError: the index cannot be written.
    """
    index = folder / "index.jsonl"
    try:
        with index.open("rb+") as stream:
            _end_after_whole_line(stream)
            stream.write("".join(json.dumps(record) + "\n" for record in records).encode())
    except OSError as error:
        raise OutputError(f'cannot write "{index}": {error.strerror or error}') from error


def _end_after_whole_line(stream: Any) -> None:
    """Move to the end of a stream, and remove an incomplete last line."""
    stream.seek(0, os.SEEK_END)
    size = stream.tell()
    stream.seek(max(0, size - 1))
    if size == 0 or stream.read(1) == b"\n":
        return
    stream.seek(0)
    whole = stream.read().rfind(b"\n") + 1
    stream.seek(whole)
    stream.truncate()


def record_of(
    k: int, parameters: Mapping[str, object], run: Trajectory | None, error: str | None, more: Table
) -> Table:
    """Return the index entry of a run.

    Args:
        k: number of the run.
        parameters: parameters of the run.
        run: trajectory of the run, or None if it failed before the first sample.
        error: message of the error that stopped the run, or None.
        more: results of `measure`.
    """
    record: Table = {
        "run": k,
        "parameters": json.loads(json.dumps(dict(parameters), default=repr)),
        "error": error,
    }
    if run is not None:
        stats = run.stats
        record |= {"t_end": float(run.t[-1]) if len(run) else None, "steps": stats.steps}
        record |= {"evaluations": stats.evaluations, "wall_s": stats.wall_s}
        record |= {"violation": float(run.violation.max(initial=0.0))}
    return record | more


def digest_of(
    make: object, parameters: Sequence[Mapping[str, object]], duration: float, options: Table
) -> str:
    """Return the digest of the inputs of a sweep that have a reproducible representation.

    Args:
        make: function that builds the scenes.
        parameters: parameters of the runs.
        duration: duration of each run [s].
        options: options of `simulate`.
    """
    content = [_canonical(make), [dict(p) for p in parameters], duration, sorted(options.items())]
    return hashlib.sha256(json.dumps(content, default=_canonical).encode()).hexdigest()


def _canonical(value: object) -> object:
    """Return a representation that is equal in all processes, for a value that JSON cannot encode."""
    if isinstance(value, partial):
        return [_canonical(value.func), value.args, value.keywords]
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    if hasattr(value, "__qualname__"):
        return f"{value.__module__}.{value.__qualname__}"
    if " at 0x" not in (text := repr(value)):
        return text
    try:  # an address differs between processes
        return [type(value).__qualname__, json.dumps(vars(value), default=_canonical)]
    except (TypeError, ValueError, RecursionError):
        return type(value).__qualname__


def partial_trajectory(error: RunError) -> Trajectory | None:
    """Return the samples before the failure of a run, or None.

    Args:
        error: error that the run raised.
    """
    trajectory = error.trajectory
    return trajectory if isinstance(trajectory, Trajectory) else None
