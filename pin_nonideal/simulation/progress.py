"""Progress bar of a run."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext

from .options import RunOptions

Tick = Callable[[float], None]


def progress_bar(progress: bool | None, options: RunOptions) -> AbstractContextManager[Tick | None]:
    """Return a context manager of a function that shows the current time, or of None without a bar.

    Args:
        progress: True, False, or None for a terminal only.
        options: options of the run.
    """
    is_shown = sys.stderr.isatty() if progress is None else progress
    return _bar(options) if is_shown else nullcontext()


@contextmanager
def _bar(options: RunOptions) -> Iterator[Tick]:
    from tqdm import tqdm

    bar_format = "{l_bar}{bar}| {n:.2f}/{total:.2f} s [{elapsed}<{remaining}]"
    with tqdm(total=options.duration, unit="s", bar_format=bar_format) as bar:

        def update(t: float) -> None:
            bar.n = t - options.t0
            bar.refresh()

        yield update
