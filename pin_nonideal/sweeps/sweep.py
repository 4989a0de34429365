"""Parallel runs of many scenes by joblib: in threads, in processes, or on a cluster (Dask, Ray)."""

from __future__ import annotations

import inspect
import os
import pickle
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from pin_nonideal.atomic_files import file_path
from pin_nonideal.compilation.callbacks import named_function
from pin_nonideal.errors import (
    InputError,
    OutputError,
    PinNonidealError,
    RunError,
    RunInterrupted,
    UserFunctionError,
    nearest,
    short_repr,
)
from pin_nonideal.scene.scene import Scene
from pin_nonideal.simulation.options import check_values
from pin_nonideal.simulation.simulate import simulate
from pin_nonideal.trajectory.file import to_bytes
from pin_nonideal.trajectory.run_list import RunList
from pin_nonideal.trajectory.trajectory import Trajectory
from pin_nonideal.types import Table
from pin_nonideal.validation import choice, count, function, number, positive, sequence

from .pack import Pack
from .store import Sweep, append_records, digest_of, open_store, partial_trajectory, record_of

MAX_JOBS = 100_000  # also of negative numbers: -n leaves n - 1 processors free
# Maximum number of runs in one task of a worker, and number of tasks for each worker. Large tasks reduce the
# overhead; many tasks balance the load.
MAX_TASK_RUNS, TASKS_PER_WORKER = 200, 16
# Arguments of `simulate` that are not options of a sweep.
EXCLUDED_OPTIONS = ("scene", "duration", "progress", "checkpoint_interval")


def sweep(
    make: Callable[..., Scene],
    parameters: Sequence[Mapping[str, object]],
    duration: float,
    *,
    jobs: int | None = None,
    store: str | os.PathLike[str] | None = None,
    failures: str = "raise",
    measure: Callable[[Trajectory], Mapping[str, float]] | None = None,
    progress: bool | None = None,
    **options: object,
) -> list[Any] | Sweep:
    """Simulate `make(**p)` for each p of `parameters`, in parallel.

    The backend is joblib's: processes by default, or the backend that `joblib.parallel_config` selects around
    the call ("threading", "dask", "ray"). For many states of one scene use `rollout`, which needs no
    processes. `sweep_grid` and `sweep_samples` create parameters.

    With `store` each run is written to a file when it ends, and the memory of a sweep does not grow with its
    trajectories. After a kill, the same call with the same folder computes the missing runs only.

    Args:
        make: function that builds a scene from one entry of `parameters`; for processes it must be a function
            of a module.
        parameters: keyword arguments of `make`, one mapping for each run.
        duration: duration of each run [s].
        jobs: number of parallel jobs; None selects joblib's default, -1 all processors, -2 all but one.
        store: folder of the runs, new or from the same sweep; None keeps the runs in memory.
        failures: "raise" stops at the first failed run. "keep" continues and returns the error in place of
            the run; its `trajectory` has the samples before the failure. A store keeps the message and those
            samples.
        measure: function run -> numbers by name, called in the worker; the numbers are stored in the index of
            a store.
        progress: progress bar on standard error; None shows it on a terminal only.
        options: options of `simulate`.

    Returns:
        Without a store, a list of one Trajectory for each run, in order and without scenes, which `make` can
        build again; notebooks show a table. With a store, a `Sweep`, which reads the runs on access.

    Raises:
        InputError: `make` cannot be called or sent to a process, `parameters` holds no mappings, `jobs` is
            not a number of jobs, or the store holds another sweep.
        OutputError: the store cannot be written; completed runs stay in it.
        RunError: a run stopped early; `index` is its number.
    """
    function("sweep: make", make, "(**parameters) -> Scene")
    table = sequence("sweep: parameters", parameters)
    for entry in table:
        if not isinstance(entry, Mapping) or not all(isinstance(key, str) for key in entry):
            raise InputError(
                f"sweep: parameters must hold mappings of keyword arguments; got {short_repr(entry)}"
            )
    length = positive("sweep: duration", duration)
    if jobs is not None and count("sweep: jobs", jobs, min_value=-MAX_JOBS, max_value=MAX_JOBS) == 0:
        raise InputError("sweep: jobs must not be zero; leave it out for joblib's choice")
    if options.get("checkpoint") is not None:
        raise InputError("sweep: checkpoint is the file of one run; its runs would overwrite one another's")
    keep = choice("sweep: failures", failures, ("raise", "keep")) == "keep"
    if measure is not None:
        function("sweep: measure", measure, "(run) -> numbers by name")
        if store is None:
            raise InputError("sweep: measure writes into the index of a store; name one, or measure the runs")
    choice("sweep: progress", progress, (True, False, None))
    _check_options(length, options)
    options["progress"] = False  # of each run
    folder = None if store is None else file_path("sweep: store", store)
    numbers = list(range(len(table)))
    if folder is not None:
        numbers = open_store(folder, digest_of(make, table, length, options), len(table))
    work = _Work(make, length, options, folder, keep, measure)
    results = RunList([None] * (len(table) if folder is None else 0))
    for part in _results(work, [(k, dict(table[k])) for k in numbers], jobs, progress):
        for k, result in part:
            if isinstance(result, PinNonidealError) and not (keep and folder is None):
                raise result
            if folder is None:
                results[k] = result
        if folder is not None:
            append_records(folder, [record for _, record in part])
    return results if folder is None else Sweep(folder)


def _check_options(duration: float, options: Table) -> None:
    """Check the options of `simulate` that do not depend on the scene.

    Raises:
        InputError: `simulate` has no such option, or refuses its value.
    """
    known = [name for name in inspect.signature(simulate).parameters if name not in EXCLUDED_OPTIONS]
    for name in options:
        if name not in known:
            raise InputError(f'sweep: `simulate` has no option "{name}"{nearest(name, known)}')
    check_values(duration, **options)


def _results(
    work: _Work, runs: list[object], jobs: int | None, progress: bool | None
) -> Iterator[list[tuple[int, Any]]]:
    """Yield the results of joblib's workers by task, in order of completion."""
    from joblib import Parallel, delayed
    from joblib.parallel import get_active_backend
    from tqdm import tqdm

    backend, configured = get_active_backend()
    requested = jobs if jobs is not None else configured
    workers = max(1, backend.effective_n_jobs(requested if requested is not None else 1))
    size = max(1, min(MAX_TASK_RUNS, len(runs) // (TASKS_PER_WORKER * workers) + 1))
    tasks = [runs[i : i + size] for i in range(0, len(runs), size)]
    lazy = getattr(backend, "supports_return_generator", False)
    parallel = Parallel(n_jobs=jobs, batch_size=1, return_as="generator_unordered" if lazy else "list")
    shown = sys.stderr.isatty() if progress is None else progress
    try:
        with tqdm(total=len(runs), unit="run", disable=not shown) as bar:
            for part in parallel(delayed(work)(each) for each in tasks):
                bar.update(len(part))
                yield part
    except (pickle.PicklingError, TypeError, AttributeError) as error:
        if "pickle" not in str(error):
            raise
        raise InputError(f"sweep: {_pickling_message(work, runs)}") from error


def _pickling_message(work: _Work, runs: list[Any]) -> str:
    """Return a message that names the first part of a sweep that cannot be serialized, and the reason."""
    try:
        import cloudpickle
    except ImportError:  # joblib before 1.6 includes a copy
        from joblib.externals import cloudpickle
    items = [("make", work.make), ("measure", work.measure), *work.options.items()]
    for name, value in [*items, *((f"parameters[{k}]", entry) for k, entry in runs)]:
        try:
            cloudpickle.dumps(value)
        except Exception as error:  # any error of the object's own methods
            return f"{name} must be picklable for another process; {type(error).__name__}: {error}"
    return "the result of a run must be picklable for another process; give a store"


class _Work:
    """Task of a worker: simulates some of the runs."""

    def __init__(
        self, make: Any, duration: float, options: Table, folder: Path | None, keep: bool, measure: Any
    ) -> None:
        self.make, self.duration, self.options = make, duration, options
        self.folder, self.keep, self.measure = folder, keep, measure

    def __call__(self, runs: list[tuple[int, Table]]) -> list[tuple[int, object]]:
        """Return the number of each run with its trajectory, its record in the store, or its error."""
        if self.folder is None:
            return [(k, self._run_in_memory(k, entry)) for k, entry in runs]
        with Pack(self.folder, runs[0][0]) as pack:
            return [(k, self._run_in_store(k, entry, pack)) for k, entry in runs]

    def _run_in_memory(self, k: int, entry: Table) -> object:
        """Return the trajectory of a run without its scene, or the error that stopped the run."""
        run, stopped = self._simulate(k, entry)
        return stopped or replace(run, scene=None)

    def _run_in_store(self, k: int, entry: Table, pack: Pack) -> object:
        """Return the record of a run in the store, or its error if an error stops the sweep."""
        run, stopped = self._simulate(k, entry)
        if stopped is not None and not self.keep:
            return stopped
        more = self._measure_run(run) if self.measure is not None and stopped is None else {}
        error = None if stopped is None else f"{type(stopped).__name__}: {stopped}"
        return pack.add(record_of(k, entry, run, error, more), b"" if run is None else to_bytes(run))

    def _simulate(self, k: int, entry: Table) -> Any:
        """Return a run and the error that stopped it; either can be None."""
        try:
            return simulate(self._scene(entry), self.duration, **self.options), None
        except (RunInterrupted, OutputError):
            raise
        except PinNonidealError as error:
            run = None
            if isinstance(error, RunError):
                error.index = k
                run = partial_trajectory(error)
                error.trajectory = None if run is None else replace(run, scene=None)
            return run, error

    def _scene(self, entry: Table) -> Any:
        try:
            scene = self.make(**entry)
        except PinNonidealError:
            raise
        except Exception as error:
            raise UserFunctionError(
                f"sweep: make raised {type(error).__name__}: {error}; it was called with {short_repr(entry)}"
            ) from error
        if not isinstance(scene, Scene):
            raise UserFunctionError(
                f"sweep: make must return a Scene; got {short_repr(scene)} for {short_repr(entry)}"
            )
        return scene

    def _measure_run(self, run: Trajectory) -> Table:
        results = named_function(self.measure, "sweep: measure")(run)
        if not isinstance(results, Mapping):
            raise UserFunctionError(f"sweep: measure must return numbers by name; got {short_repr(results)}")
        return {str(name): number(f'sweep: measure: "{name}"', x) for name, x in results.items()}
