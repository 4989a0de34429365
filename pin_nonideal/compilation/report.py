"""What a scene is made of, in words: `Scene.report`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pin_nonideal.laws import JointFriction

if TYPE_CHECKING:
    from pin_nonideal.scene import Scene

UNLIMITED = 1e3  # positions that no joint reaches [rad or m]


def report(scene: Scene, rank: int) -> str:
    """Joints, constraints, rows, rank, mobility, and what was left out.

    Args:
        scene: the scene.
        rank: of its rows in the initial state.
    """
    model = scene.model
    rows = max((s.stop for s in scene.constraint_slices.values()), default=0)
    lines = [f"{scene.name}: {model.njoints - 1} joints, nq {model.nq}, nv {model.nv}"]
    for i in range(1, model.njoints):
        kind = model.joints[i].shortname().removeprefix("JointModel")
        lines.append(f"  joint {model.names[i]}: {kind}, on {model.names[model.parents[i]]}")
    for name, s in scene.constraint_slices.items():
        lines.append(f"  constraint {name}: {s.stop - s.start} rows")
    for name in scene.law_names:
        lines.append(f"  law {name}")
    lines.append(f"rows {rows}, rank {rank}, mobility {model.nv - rank}")
    for name, row, reason in scene.dropped:
        lines.append(f"  left out: row {row} of {name}: {reason}")
    redundant = rows - len(scene.dropped) - rank
    if redundant > 0:
        lines.append(f"  redundant: {redundant} further rows, decided at every step")
    lines.append("skipped: " + (", ".join(_skipped(scene)) or "nothing"))
    lines += [f"note: {n}" for n in scene.notes]
    for key in ("source", "licence"):
        if getattr(scene, key):
            lines.append(f"{key}: {getattr(scene, key)}")
    return "\n".join(lines)


def _skipped(scene: Scene) -> list[str]:
    """Parts of an evaluation that this scene does without."""
    skipped = []
    if not scene.constraint_slices:
        skipped.append("rows and their factorization (no constraint)")
    if not scene.law_names:
        skipped.append("laws C (none)")
    depends = any(isinstance(law, JointFriction) and law.mu for law in scene.laws)
    depends |= any(getattr(law, "reaction", None) for law in scene.laws if not isinstance(law, JointFriction))
    if not depends and not any(c.mu for c in scene.contacts):
        skipped.append("reactions (no law reads them)")
    if not scene.forces and scene.actuation is None:
        skipped.append("given forces (none)")
    if any(_limited(scene.model, joint) for joint in range(1, scene.model.njoints)):
        skipped.append("limits of joints (the motion may pass them)")
    return skipped


def _limited(model: Any, joint: int) -> bool:
    """Whether a joint of one degree of freedom has a limit of position that it could reach."""
    i = model.idx_qs[joint]
    bounds = (model.lowerPositionLimit[i], model.upperPositionLimit[i])
    return model.nqs[joint] == 1 and any(abs(bound) < UNLIMITED for bound in bounds)
