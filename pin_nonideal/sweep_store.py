"""Runs of a sweep in a folder: an npz a run, and an index of what became of each."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .errors import InputError, LoadingError, OutputError, RunError
from .files import file_path
from .trajectory import Trajectory
from .types import Table

FORMAT = 1
IN_A_FOLDER = 1000
QUANTILES = (0.0, 0.05, 0.25, 0.5, 0.75, 0.95, 1.0)


class Sweep(Sequence[Trajectory]):
    """Runs of a sweep that are kept in a folder, read one at a time when asked for.

    Args:
        folder: that `sweep(..., store=folder)` filled.

    Attributes:
        folder: see above.
        records: of each run, in order: its `parameters`, `error` (what stopped it, or None), `t_end`,
            `steps`, `evaluations`, `violation` (largest), `wall_s`, and what `measure` gave; None of a run
            that is missing.

    Raises:
        LoadingError: there is no sweep in it.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = file_path("Sweep: folder", folder)
        try:
            with (self.folder / "index.jsonl").open(encoding="utf-8") as lines:
                self._header = json.loads(next(lines))
                self.records: list[Table | None] = [None] * int(self._header["runs"])
                for line in lines:
                    if line.endswith("\n"):  # not cut off by a kill
                        record = json.loads(line)
                        self.records[record.pop("run")] = record
        except (OSError, ValueError, LookupError, TypeError, StopIteration) as error:
            raise LoadingError(
                f'"{self.folder}" holds no sweep: {type(error).__name__}: {error}; it must be a folder that '
                "sweep(..., store=folder) made"
            ) from error

    def __len__(self) -> int:
        return len(self.records)

    def __getitem__(self, k: Any) -> Any:
        if isinstance(k, slice):
            return [self[i] for i in range(*k.indices(len(self)))]
        k = range(len(self))[k]
        return Trajectory.load(run_file(self.folder, k), scene=None)

    def __iter__(self) -> Iterator[Trajectory]:
        return (self[k] for k in range(len(self)))

    def __str__(self) -> str:
        done = len(self) - len(self.missing)
        return f"sweep in {self.folder}: {done} of {len(self)} runs, {len(self.failures)} of them failed"

    @property
    def missing(self) -> list[int]:
        """Runs that are not done."""
        return [k for k, record in enumerate(self.records) if record is None]

    @property
    def failures(self) -> dict[int, str]:
        """What stopped the runs that failed."""
        return {k: r["error"] for k, r in enumerate(self.records) if r is not None and r["error"] is not None}

    def summary(self) -> Table:
        """Over all runs that are done, without reading them: mean, deviation and quantiles of each number.

        Returns:
            By name of the number ("violation", "steps", ..., and those of `measure`): "mean", "std", "count",
            "quantiles" (by level) and "worst" (the run with the largest one).
        """
        done = [(k, r) for k, r in enumerate(self.records) if r is not None]
        names = sorted({key for _, r in done for key, x in r.items() if isinstance(x, (int, float))})
        table: Table = {}
        for name in names:
            runs, values = zip(
                *((k, r[name]) for k, r in done if isinstance(r.get(name), (int, float))), strict=True
            )
            x = np.array(values, dtype=float)
            levels = {level: float(np.quantile(x, level)) for level in QUANTILES}
            worst = int(runs[int(np.argmax(x))])
            table[name] = {"mean": float(x.mean()), "std": float(x.std()), "count": len(x)}
            table[name] |= {"quantiles": levels, "worst": worst}
        return table


def run_file(folder: Path, k: int) -> Path:
    """Where a run lies.

    Args:
        folder: of the sweep.
        k: number of the run.
    """
    return folder / f"{k // IN_A_FOLDER:04d}" / f"{k:07d}.npz"


def opened_store(folder: Path, digest: str, runs: int) -> list[int]:
    """Begins a sweep in a folder, or goes on with it; the runs that are missing.

    Args:
        folder: of the sweep.
        digest: of all that decides it.
        runs: how many there are.

    Raises:
        InputError: the folder holds another sweep.
        OutputError: it cannot be written.
    """
    index = folder / "index.jsonl"
    if index.exists():
        held = Sweep(folder)
        if held._header.get("digest") != digest or held._header.get("format") != FORMAT:
            raise InputError(
                f'sweep: store "{folder}" holds another sweep: its parameters, duration or options differ; '
                "name another folder"
            )
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


def note(folder: Path, records: Sequence[Table]) -> None:
    """Adds what became of some runs to the index.

    Args:
        folder: of the sweep.
        records: of the runs, each with its number as "run".

    Raises:
        OutputError: it cannot be written.
    """
    index = folder / "index.jsonl"
    try:
        with index.open("rb+") as stream:
            _end_after_whole_line(stream)
            stream.write("".join(json.dumps(record) + "\n" for record in records).encode())
    except OSError as error:
        raise OutputError(f'cannot write "{index}": {error.strerror or error}') from error


def _end_after_whole_line(stream: Any) -> None:
    """Goes to the end, without the part of a line that a kill left behind."""
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
    k: int, parameters: Mapping[str, Any], run: Trajectory | None, error: str | None, more: Table
) -> Table:
    """What the index tells of a run.

    Args:
        k: its number.
        parameters: its own.
        run: its trajectory, or None where there is none.
        error: what stopped it, or None.
        more: what `measure` gave.
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


def digest_of(make: Any, parameters: Sequence[Mapping[str, Any]], duration: float, options: Table) -> str:
    """Of all that decides a sweep, as far as it has a name.

    Args:
        make: what builds its scenes.
        parameters: of its runs.
        duration: of each [s].
        options: of `simulate`.
    """
    name = getattr(make, "__qualname__", repr(type(make)))
    said = [name, [dict(p) for p in parameters], duration, sorted((k, repr(x)) for k, x in options.items())]
    return hashlib.sha256(json.dumps(said, default=repr).encode()).hexdigest()


def failed_run(error: RunError) -> Trajectory | None:
    """What a run had computed when it failed, or None.

    Args:
        error: what it raised.
    """
    found = error.trajectory
    return found if isinstance(found, Trajectory) else None
