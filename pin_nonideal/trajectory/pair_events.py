"""Events of contact points as events of the contacts of the user."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.compilation.contact_groups import OPEN, STICK
from pin_nonideal.types import Array

from .records import Event

# Kinds of events by the change that they need in the contact.
OPENS_OR_CLOSES = {"touch_down": True, "lift_off": False}
SLIPS = {"slip": True, "reverse": True, "stick": False}


class ContactStates:
    """States of the contacts of a run just before and after its events.

    Args:
        t: times of all samples [s], (nt,).
        closed: whether each contact is closed, (nt, n).
        names: names of the contacts.
        modes: modes of the friction elements, (nt, ne).
        elements: names of the elements.
    """

    def __init__(
        self,
        t: Array,
        closed: NDArray[np.bool_],
        names: Sequence[str],
        modes: NDArray[np.int8],
        elements: Sequence[str],
    ) -> None:
        self._t, self._closed, self._modes = t, closed, modes
        self._contacts = {name: k for k, name in enumerate(names)}
        self._elements = {name: k for k, name in enumerate(elements)}

    def changes(self, event: Event) -> bool:
        """Check if an event of a point changes whether its contact is closed, or its mode.

        Args:
            event: event with the name of the contact.
        """
        if not len(self._t):
            return True
        after = int(np.searchsorted(self._t, event.time, side="right")) - 1
        before = int(np.searchsorted(self._t, event.time, side="left")) - 1
        if event.kind in OPENS_OR_CLOSES:
            closed, closes = self._closed[:, self._contacts[event.element]], OPENS_OR_CLOSES[event.kind]
            return closed[after] == closes and (before < 0 or closed[before] != closes)
        if event.kind in SLIPS and event.element in self._elements:
            modes, slips = self._modes[:, self._elements[event.element]], SLIPS[event.kind]
            return _has_mode(modes[after], slips) and (before < 0 or not _has_mode(modes[before], slips))
        return True


def _has_mode(mode: np.int8, slips: bool) -> bool:
    return mode not in (STICK, OPEN) if slips else mode == STICK


def contact_events(
    events: Iterable[Event], contact: Callable[[str], str], states: Callable[[], ContactStates]
) -> list[Event]:
    """Return events with the names of contacts in place of their points.

    Impacts of several points of a contact at one time are one event with the sum of their impulses. Other
    events of points are events of the contact if they change whether it is closed, or its mode.

    Args:
        events: events of the core, in order of time.
        contact: function that returns the contact of a point, and other names as they are.
        states: function that returns the states of the contacts at the events.
    """
    found: dict[tuple[object, ...], Event] = {}
    known: ContactStates | None = None
    for number, event in enumerate(events):
        name = contact(event.element)
        if name == event.element:
            found[number,] = event
            continue
        known = known or states()
        event = replace(event, element=name)
        speed = None if event.v_minus is None else event.v_minus.tobytes()
        key = (event.time, event.kind, name, speed)
        if key in found:
            found[key] = _together(found[key], event)
        elif known.changes(event):
            found[key] = event
    return list(found.values())


def _together(first: Event, second: Event) -> Event:
    """Return one event of two points at the same time."""
    if first.impulse is None or second.impulse is None:
        return replace(first, miss=max(first.miss, second.miss))
    return replace(
        first,
        impulse=first.impulse + second.impulse,
        energy_change=first.energy_change + second.energy_change,
    )
