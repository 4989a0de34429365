"""Many runs of scenes that differ: joblib carries them in threads, processes, or on a cluster (Dask, Ray)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from .checks import count, function, sequence
from .errors import InputError
from .scene import Scene
from .simulation import simulate
from .trajectory import Trajectory
from .types import Table

MOST_JOBS = 100_000  # also of negative numbers: -n leaves n - 1 processors free


def sweep(
    make: Callable[..., Scene],
    parameters: Sequence[Mapping[str, Any]],
    duration: float,
    *,
    jobs: int | None = None,
    **options: Any,
) -> list[Trajectory]:
    """Simulates `make(**p)` for each p of `parameters`, in parallel.

    The backend is joblib's: processes by default, or what `joblib.parallel_config` chooses around the call
    ("threading", "dask", "ray").  For many states of one scene use `rollout`, which needs no processes.

    Args:
        make: builds a scene from one entry of `parameters`; for processes it must be a function of a module.
        parameters: keyword arguments, one mapping a run.
        duration: length of time [s].
        jobs: number of parallel jobs; joblib's choice when None, all processors when -1, all but one when -2.
        options: passed to `simulate`.

    Returns:
        One Trajectory a run, in order; `scene` is None when it came from another process.

    Raises:
        InputError: `make` cannot be called, `parameters` holds no mappings, or `jobs` is no number of jobs.
        RunError: a run stopped early.
    """
    from joblib import Parallel, delayed

    function("sweep: make", make, "(**parameters) -> Scene")
    table = sequence("sweep: parameters", parameters)
    for entry in table:
        if not isinstance(entry, Mapping):
            raise InputError(f"sweep: parameters must hold mappings of keyword arguments; got {entry!r}")
    if jobs is not None and count("sweep: jobs", jobs, least=-MOST_JOBS, most=MOST_JOBS) == 0:
        raise InputError("sweep: jobs must not be zero; leave it out for joblib's choice")
    if options.get("checkpoint") is not None:
        raise InputError("sweep: checkpoint is the file of one run; its runs would overwrite one another's")
    options.setdefault("progress", False)
    runs: list[Trajectory] = Parallel(n_jobs=jobs)(
        delayed(_one)(make, dict(p), duration, options) for p in table
    )
    return runs


def _one(make: Callable[..., Scene], entry: Table, duration: float, options: Table) -> Trajectory:
    return simulate(make(**entry), duration, **options)
