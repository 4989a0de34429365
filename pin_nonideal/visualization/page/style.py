"""Colors and descriptions of events, modes and forces, shared by the replay page and matplotlib."""

from __future__ import annotations

# Kinds of events in the order of their legend; unknown kinds are drawn as "other".
EVENTS = {
    "stick": ("#475569", "begins to stick"),
    "slip": ("#0f766e", "begins to slip"),
    "reverse": ("#7c3aed", "slip reverses"),
    "pull": ("#dc2626", "a bilateral contact pulls"),
    "impact": ("#b91c1c", "strikes, with an impulse"),
    "touch_down": ("#92400e", "closes without an impulse"),
    "lift_off": ("#0369a1", "opens"),
    "relaxed": ("#7f1d1d", "steps violate the laws of a contact from this time on"),
    "chatter": ("#0891b2", "a cluster of events, bridged by time stepping"),
    "several": ("#db2777", "the laws allow several motions from this time on"),
    "paradox": ("#9d174d", "the laws allow no motion at a step's end"),
    "saturate": ("#a16207", "a drive reaches its effort limit"),
    "desaturate": ("#ca8a04", "a drive returns below its effort limit"),
    "jump": ("#be185d", "a prescribed rate jumps, with an impulse"),
    "user": ("#65a30d", "a zero of a user function"),
    "other": ("#64748b", "another event"),
}
# Modes of friction elements and contacts.
MODES = {
    1: ("#0f766e", "slip +"),
    -1: ("#5eead4", "slip -"),
    0: ("#475569", "stick"),
    2: ("#e2e8f0", "open"),
    3: ("#b45309", "closed"),
}
OPEN, CLOSED = 2, 3
UNKNOWN_MODE = ("#f1f5f9", "no mode")
# Parts of the constraint force, Eq. (39), and other forces.
FORCES = {
    "ideal": "#2563eb",
    "nonideal": "#ea580c",
    "total": "#be185d",
    "drive": "#7c3aed",
    "spring": "#4d7c0f",
    "drag": "#0e7490",
    "given": "#57534e",
}
MARKS = {"anchor": "#d97706", "rod": "#d97706", "spring": "#64748b", "contact": "#475569", "guide": "#a8763e"}
CURVES = ("#1d4ed8", "#b45309", "#0f766e", "#be123c", "#6d28d9", "#4d7c0f", "#c026d3", "#57534e")


def event_color(kind: str) -> str:
    """Return the color of a kind of event.

    Args:
        kind: kind as in `Event.kind`.
    """
    return EVENTS.get(kind, EVENTS["other"])[0]


def table() -> dict[str, object]:
    """Return all colors and descriptions in the format of the page."""
    return {
        "events": {kind: {"color": color, "means": means} for kind, (color, means) in EVENTS.items()},
        "modes": {str(mode): {"color": color, "name": name} for mode, (color, name) in MODES.items()},
        "no_mode": {"color": UNKNOWN_MODE[0], "name": UNKNOWN_MODE[1]},
        "forces": FORCES,
        "marks": MARKS,
        "curves": list(CURVES),
    }
