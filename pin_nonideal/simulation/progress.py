"""The bar that shows how far a run has come."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext

from .options import RunOptions

Tick = Callable[[float], None]


def progress_bar(progress: bool | None, options: RunOptions) -> AbstractContextManager[Tick | None]:
    """While a run lasts, a function that shows the time it has come to; None where no bar is wanted.

    Args:
        progress: True, False, or None for a terminal only.
        options: of the run.
    """
    wanted = sys.stderr.isatty() if progress is None else progress
    return _bar(options) if wanted else nullcontext()


@contextmanager
def _bar(options: RunOptions) -> Iterator[Tick]:
    from tqdm import tqdm

    bar_format = "{l_bar}{bar}| {n:.2f}/{total:.2f} s [{elapsed}<{remaining}]"
    with tqdm(total=options.duration, unit="s", bar_format=bar_format) as bar:

        def update(t: float) -> None:
            bar.n = t - options.t0
            bar.refresh()

        yield update
