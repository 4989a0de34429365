"""Text summary of a scene: `Scene.report`."""

from __future__ import annotations

from collections.abc import Sequence

from pin_nonideal.description.contacts import JointLimit
from pin_nonideal.description.contacts.pair_of_shapes import given_contacts
from pin_nonideal.description.drive_lists import drives_of
from pin_nonideal.description.laws import JointFriction
from pin_nonideal.types import Model

from .compiled_scene import CompiledScene
from .contact_groups import contact_names

MAX_POSITION_LIMIT = 1e3  # position limits from here on are never reached [rad or m]


def report(scene: CompiledScene, name: str, rank: int, notes: Sequence[str]) -> str:
    """Return a text with joints, constraints, rows, rank, mobility and removed rows.

    Args:
        scene: the compiled scene.
        name: title.
        rank: rank of the rows in the initial state.
        notes: lines to append.
    """
    model, opening = scene.model, set(scene.opening_names)
    rows = scene.program.rows - len(opening)
    contacts = contact_names(scene.opening_names, scene.contact_of)
    lines = [f"{name}: {model.njoints - 1} joints, nq {model.nq}, nv {model.nv}"]
    for i in range(1, model.njoints):
        kind = model.joints[i].shortname().removeprefix("JointModel")
        lines.append(f"  joint {model.names[i]}: {kind}, on {model.names[model.parents[i]]}")
    for name, (first, end, is_contact) in scene.rows.items():
        what = "contact" if is_contact else "constraint"
        points = f" of {len(scene.points[name])} points" if name in scene.points else ""
        opens = ", may open" if name in contacts else ""
        lines.append(f"  {what} {name}: {end - first} rows{points}{opens}")
    for name in scene.laws.names:
        lines.append(f"  law {name}")
    lines += [f"  force {_label(force)}" for force in scene.spec.forces]
    lines += [f"  actuation {_label(drive)}" for drive in drives_of(scene.spec.actuation)]
    limited = [str(model.names[i]) for i in _joints_without_stops(scene)]
    if limited:
        lines.append(f"  limits, which the motion may pass: {', '.join(limited)}")
    lines.append(f"rows {rows}, rank {rank}, mobility {model.nv - rank}")
    if opening:
        points = f" of {len(opening)} points" if scene.points else ""
        lines.append(
            f"  contacts that may open: {len(contacts)}{points}, a row and its friction each while closed"
        )
    for name, row, reason in scene.dropped:
        lines.append(f"  left out: row {row} of {name}: {reason}")
    redundant = rows - sum(name not in contacts for name, _, _ in scene.dropped) - rank
    if redundant > 0:
        lines.append(f"  redundant: {redundant} further rows, decided at every step")
    lines.append("skipped: " + (", ".join(_skipped_parts(scene)) or "nothing"))
    return "\n".join([*lines, *notes])


def _label(spec: object) -> str:
    """Return a label of a force or an actuation: its name, joint or frame, and its kind."""
    kind = type(spec).__name__
    name = getattr(spec, "name", None) or getattr(spec, "joint", None) or getattr(spec, "frame", None)
    if kind in ("ndarray", "list", "tuple", "dict"):
        return "constant torques"
    return f"{name} ({kind})" if isinstance(name, str) else {"function": "function (t, q, v)"}.get(kind, kind)


def _skipped_parts(scene: CompiledScene) -> list[str]:
    """Return the parts of an evaluation that this scene skips."""
    skipped = []
    if not scene.slices:
        skipped.append("rows and their factorization (no constraint)")
    if not scene.program.law_names:
        skipped.append("laws C (none)")
    spec = scene.spec
    depends = any(isinstance(law, JointFriction) and law.mu for law in spec.laws)
    depends |= any(getattr(law, "reaction", None) for law in spec.laws if not isinstance(law, JointFriction))
    if not depends and not any(getattr(c, "mu", 0.0) for c in given_contacts(spec.contacts)):
        skipped.append("reactions (no law reads them)")
    if not spec.forces and spec.actuation is None:
        skipped.append("given forces (none)")
    if _joints_without_stops(scene):
        skipped.append("limits of joints (the motion may pass them)")
    return skipped


def _joints_without_stops(scene: CompiledScene) -> list[int]:
    """Return the joints with position limits that are not stops of the scene."""
    stops = {c.joint for c in scene.spec.contacts if isinstance(c, JointLimit)}
    model = scene.model
    return [
        i
        for i in range(1, model.njoints)
        if _has_position_limit(model, i) and str(model.names[i]) not in stops
    ]


def _has_position_limit(model: Model, joint: int) -> bool:
    """Check if a joint with one position coordinate has a reachable position limit."""
    i = model.idx_qs[joint]
    bounds = (model.lowerPositionLimit[i], model.upperPositionLimit[i])
    return model.nqs[joint] == 1 and any(abs(bound) < MAX_POSITION_LIMIT for bound in bounds)
