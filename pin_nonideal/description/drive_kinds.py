"""Drives of an actuation, by kind."""

from __future__ import annotations

from typing import Any

from .actuation import EffortLimits, SampledControl, Table
from .drive_lists import drives_of
from .scene_drive import SceneDrive


def requesting_drives(actuation: object) -> list[object]:
    """Return the drives that request torques, including drives inside `EffortLimits`.

    Args:
        actuation: the actuation of a scene, as returned by `given_actuation`.
    """
    requesting: list[object] = []
    for drive in drives_of(actuation):
        requesting += drives_of(drive.actuation) if isinstance(drive, EffortLimits) else [drive]
    return requesting


def sampled_drives(actuation: object) -> list[Any]:
    """Return the drives that hold their torque between samples of a period.

    Args:
        actuation: the actuation of a scene, as returned by `given_actuation`.
    """
    kinds = (SampledControl, SceneDrive)
    return [d for d in requesting_drives(actuation) if isinstance(d, kinds) and d.period is not None]


def delayed_control(actuation: object) -> SampledControl | None:
    """Return the sampled control with a delay, or None; `lower_actuation` refuses a second one.

    Args:
        actuation: the actuation of a scene, as returned by `given_actuation`.
    """
    controls = (d for d in requesting_drives(actuation) if isinstance(d, SampledControl))
    return next((d for d in controls if d.delay_in_samples), None)


def held_tables(actuation: object) -> list[Table]:
    """Return the tables that hold each torque until the next time.

    Args:
        actuation: the actuation of a scene, as returned by `given_actuation`.
    """
    return [d for d in requesting_drives(actuation) if isinstance(d, Table) and d.interpolation == "hold"]


def switching_drives(actuation: object) -> list[object]:
    """Return the drives whose torques jump at times that end steps.

    Args:
        actuation: the actuation of a scene, as returned by `given_actuation`.
    """
    return sampled_drives(actuation) + held_tables(actuation)
