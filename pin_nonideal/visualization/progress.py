"""Progress bar of a page while it is made."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext

# Shows the next of the stages, by its name.
Stage = Callable[[str], None]
# A bar appears after this time [s].
DELAY = 1.0


def stages(progress: bool | None, count: int) -> AbstractContextManager[Stage]:
    """Return a context manager of a function that shows the next stage of some work.

    Args:
        progress: True, False, or None for a terminal only.
        count: number of stages.
    """
    is_shown = sys.stderr.isatty() if progress is None else progress
    return _bar(count) if is_shown else nullcontext(_silent)


def _silent(name: str) -> None:
    """Show nothing."""


@contextmanager
def _bar(count: int) -> Iterator[Stage]:
    from tqdm import tqdm

    bar_format = "replay: {desc} {bar}| {n_fmt}/{total_fmt} [{elapsed}]"
    with tqdm(total=count, delay=DELAY, bar_format=bar_format) as bar:
        begun = False

        def begin(name: str) -> None:
            nonlocal begun
            bar.update(int(begun))  # the stage before is over
            bar.set_description_str(name)
            begun = True

        yield begin
        bar.update(1)
