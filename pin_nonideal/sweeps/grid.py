"""Parameters of sweeps: grids and space-filling samples of a box."""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Iterable

import numpy as np

from pin_nonideal.errors import InputError, short_repr
from pin_nonideal.types import Table
from pin_nonideal.validation import array, choice, count


def sweep_grid(**axes: Iterable[object]) -> list[Table]:
    """Return all combinations of the values of each parameter; the last parameter changes fastest.

    Args:
        axes: values of each parameter, by name.

    Returns:
        One mapping for each run, for `sweep`.

    Raises:
        InputError: the values of a parameter are not a list.
    """
    for name, values in axes.items():
        if (
            isinstance(values, (str, bytes))
            or not isinstance(values, Iterable)
            or getattr(values, "ndim", 1) == 0
        ):
            raise InputError(f"sweep_grid: {name} must be a list of values; got {short_repr(values)}")
    listed = [[_plain_value(value) for value in values] for values in axes.values()]
    return [dict(zip(axes, point, strict=True)) for point in itertools.product(*listed)]


def sweep_samples(
    n: int, *, kind: str = "sobol", seed: int = 0, **ranges: tuple[float, float]
) -> list[Table]:
    """Return samples of a box of parameters, drawn by scipy.stats.qmc.

    Args:
        n: number of samples; a power of two keeps "sobol" balanced.
        kind: "sobol" (scrambled), "latin" (hypercube), "halton", or "random".
        seed: seed of the scrambling; equal seeds give equal samples.
        ranges: (minimum, maximum) of each parameter, by name.

    Returns:
        One mapping for each run, for `sweep`.

    Raises:
        InputError: an argument is invalid.
    """
    number = count("sweep_samples: n", n, min_value=1)
    choice("sweep_samples: kind", kind, ("sobol", "latin", "halton", "random"))
    count("sweep_samples: seed", seed)
    if not ranges:
        raise InputError("sweep_samples needs the range of a parameter, such as mu=(0.1, 0.5)")
    bounds = np.array([array(f"sweep_samples: {name}", pair, (2,)) for name, pair in ranges.items()])
    for name, (min_value, max_value) in zip(ranges, bounds.tolist(), strict=True):
        if min_value > max_value:
            raise InputError(
                f"sweep_samples: {name} must be (minimum, maximum); got ({min_value:g}, {max_value:g}); "
                "exchange the two"
            )
    from scipy.stats import qmc

    d = len(ranges)
    if kind == "random":
        unit = np.random.default_rng(seed).random((number, d))
    else:
        engines = {"sobol": qmc.Sobol, "latin": qmc.LatinHypercube, "halton": qmc.Halton}
        with warnings.catch_warnings():  # the warning that a number is not a power of two
            warnings.simplefilter("ignore", UserWarning)
            unit = engines[kind](d=d, seed=int(seed)).random(number)
    points = bounds[:, 0] + unit * (bounds[:, 1] - bounds[:, 0])
    return [dict(zip(ranges, point.tolist(), strict=True)) for point in points]


def _plain_value(value: object) -> object:
    return value.item() if isinstance(value, np.generic) else value
