"""Items of a replay page as JSON objects, with their arrays in the payload."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pin_nonideal.types import Array, Table

from .binary import Payload
from .constraint_curves import Guide
from .force_arrows import Arrow
from .frames import Motion
from .friction_glyphs import Element
from .markers import Mark
from .signal_list import Signal, without_rounding
from .signals import Plot


def stored_signal(payload: Payload, signal: Signal, rounding: dict[str, float]) -> Table:
    """Return a signal with zero in place of rounding.

    Args:
        payload: arrays of the page.
        signal: the signal.
        rounding: rounding by unit.
    """
    return {
        "label": signal.label,
        "unit": signal.unit,
        "section": signal.section,
        "words": signal.words,
        "t": payload.add(signal.t, "f8"),
        "values": payload.add(without_rounding(signal.values, rounding[signal.unit])),
    }


def stored_plot(payload: Payload, plot: Plot) -> Table:
    """Return a plot with its curves.

    Args:
        payload: arrays of the page.
        plot: the plot.
    """
    curves = [{"label": k, "values": payload.curve(v)} for k, v in plot.curves.items()]
    return {
        "title": plot.title,
        "unit": plot.unit,
        "note": plot.note,
        "log": plot.log,
        "t": payload.add(plot.t, "f8"),
        "curves": curves,
    }


def stored_arrow(payload: Payload, motion: Motion, arrow: Arrow) -> Table:
    """Return an arrow with its origin in the frame of its joint, stored once if it is constant.

    Args:
        payload: arrays of the page.
        motion: motion of the run by frames.
        arrow: the arrow.
    """
    stored = plain_fields(arrow, ("values", "origin"))
    stored["values"] = payload.add(arrow.values)
    if arrow.origin is not None:
        stored["origin"] = payload.add(
            _without_repetition(motion.local(arrow.joint, arrow.origin), motion.size)
        )
    return stored


def stored_mark(payload: Payload, motion: Motion, mark: Mark) -> Table:
    """Return a mark of a constraint or contact.

    Args:
        payload: arrays of the page.
        motion: motion of the run by frames.
        mark: the mark.
    """
    stored = plain_fields(mark, ("path", "closed"))
    stored["path"] = None if mark.path is None else payload.add(_without_repetition(mark.path, motion.size))
    stored["closed"] = None if mark.closed is None else payload.add(mark.closed, "u1")
    return stored


def stored_element(payload: Payload, motion: Motion, element: Element) -> Table:
    """Return a friction element with its cone.

    Args:
        payload: arrays of the page.
        motion: motion of the run by frames.
        element: the element.
    """
    stored = plain_fields(element, ("point", "axis", "share", "normal"))
    for key, size in (("point", motion.size), ("axis", 1.0)):
        stored[key] = payload.add(_without_repetition(np.atleast_2d(getattr(element, key)), size))
    for key in ("share", "normal"):
        if stored[key] is not None:
            stored[key] = payload.add(getattr(element, key))
    return stored


def stored_guide(payload: Payload, guide: Guide) -> Table:
    """Return the curve of a constraint.

    Args:
        payload: arrays of the page.
        guide: the curve.
    """
    apart = ("points", "shift", "normals")
    stored = plain_fields(guide, apart)
    for key in apart:
        if stored[key] is not None:
            stored[key] = payload.add(getattr(guide, key))
    return stored


def plain_fields(item: object, apart: Sequence[str] = ()) -> Table:
    """Return the fields of a dataclass, with arrays as lists, except those that are stored apart.

    Args:
        item: a dataclass.
        apart: names of the fields whose arrays stay.
    """
    return {
        key: v.tolist() if isinstance(v, np.ndarray) and key not in apart else v
        for key, v in vars(item).items()
    }


def _without_repetition(vectors: Array, size: float) -> Array:
    """Return vectors at all frames, (n, 3), or one vector, (1, 3), if they are constant."""
    return vectors[:1] if np.abs(vectors - vectors[0]).max() < 1e-9 * size else vectors
