"""Events of contact points as events of the contacts of the user."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.compilation.contact_groups import OPEN, SLIP_PLUS, STICK, Groups
from pin_nonideal.types import Array

from .records import Event

# Kinds of events, by the required change of the contact.
OPENS_OR_CLOSES = {"touch_down": True, "lift_off": False}
SLIPS = {"slip": True, "reverse": True, "stick": False}


class ContactStates:
    """States of the contacts of a run just before and after its events.

    Samples at the time of an event show both. Between samples the events change the states of the points.

    Args:
        t: times of all samples [s], (nt,).
        contacts: contacts of the points.
        points: names of the points.
        closed: whether each point is closed, (nt, points).
        elements: friction elements of the user.
        element_names: names of the elements of the core.
        modes: modes of the elements of the core, (nt, elements).
    """

    def __init__(
        self,
        t: Array,
        contacts: Groups,
        points: Sequence[str],
        closed: NDArray[np.bool_],
        elements: Groups,
        element_names: Sequence[str],
        modes: NDArray[np.int8],
    ) -> None:
        self._t, self._all_closed, self._all_modes = t, closed, modes
        self._contacts, self._elements = contacts, elements
        self._points = {name: k for k, name in enumerate(points)}
        self._element_of = {name: k for k, name in enumerate(element_names)}
        self._contact = {name: k for k, name in enumerate(contacts.names)}
        self._mode = {name: k for k, name in enumerate(elements.names)}
        self._now = -np.inf  # time of the current states
        self._is_start = True
        if len(t):
            self._read(0)
        self._before, self._after = self._states(), self._states()

    def _read(self, sample: int) -> None:
        self._closed, self._modes = self._all_closed[sample].copy(), self._all_modes[sample].copy()

    def _states(self) -> tuple[NDArray[np.bool_], NDArray[np.int8]]:
        if not len(self._t):
            return np.zeros(0, dtype=np.bool_), np.zeros(0, dtype=np.int8)
        modes = self._elements.modes(self._modes) if self._elements.names else self._modes
        return self._contacts.any(self._closed), modes

    def move(self, events: Sequence[Event]) -> None:
        """Move to the next time with events.

        Args:
            events: all events at that time, with the names of points.
        """
        if not len(self._t):
            return
        time = events[0].time
        before = int(np.searchsorted(self._t, time, side="left")) - 1
        after = int(np.searchsorted(self._t, time, side="right")) - 1
        if before >= 0 and self._t[before] >= self._now:
            self._read(before)
        self._is_start = before < 0
        self._before = self._states()
        if after > before:
            self._read(after)
        else:
            for event in events:
                self._apply(event)
        self._now = time
        self._after = self._states()

    def _apply(self, event: Event) -> None:
        point, element = self._points.get(event.element), self._element_of.get(event.element)
        if event.kind in OPENS_OR_CLOSES and point is not None:
            closes = OPENS_OR_CLOSES[event.kind]
            self._closed[point] = closes
            if element is not None:
                self._modes[element] = SLIP_PLUS if closes else OPEN
        elif event.kind in SLIPS and element is not None:
            self._modes[element] = SLIP_PLUS if SLIPS[event.kind] else STICK

    def changes(self, event: Event) -> bool:
        """Check if an event of a point changes whether its contact is closed, or its mode.

        Args:
            event: event with the name of the contact, at the time of the last move.
        """
        if not len(self._t):
            return True
        if event.kind in OPENS_OR_CLOSES:
            contact, closes = self._contact[event.element], OPENS_OR_CLOSES[event.kind]
            was, is_closed = self._before[0][contact], self._after[0][contact]
            return bool(is_closed == closes and (self._is_start or was != closes))
        if event.kind in SLIPS and event.element in self._mode:
            element, slips = self._mode[event.element], SLIPS[event.kind]
            was, mode = self._before[1][element], self._after[1][element]
            return _has_mode(mode, slips) and (self._is_start or not _has_mode(was, slips))
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
    for _, group in itertools.groupby(events, key=lambda event: event.time):
        together = list(group)
        if any(contact(event.element) != event.element for event in together):
            known = known or states()
            known.move(together)
        for event in together:
            name = contact(event.element)
            if known is None or name == event.element:
                found[len(found), "other"] = event
                continue
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
