"""Forces, torques and wrenches of contacts: the resultants of the forces at their points."""

from __future__ import annotations

import numpy as np

from pin_nonideal.compilation.compiled_scene import CompiledScene
from pin_nonideal.compilation.contact_groups import Groups
from pin_nonideal.core_loader import core
from pin_nonideal.states.kinematics import frame_motion
from pin_nonideal.types import Array, Table

from .contact_points import contact_bodies, contact_lines
from .point_samples import PointSamples

WRENCH = 12  # numbers of a reaction: force and moment in its own axes, then in world axes


def contact_forces(compiled: CompiledScene, outcome: core.Outcome, points: PointSamples | None) -> Table:
    """Return the fields `contact_forces` and `contact_torques` of the contacts between two frames.

    Args:
        compiled: compiled scene of the run.
        outcome: result of the core.
        points: samples of the points of pairs of shapes.
    """
    nt = len(outcome.t)
    names = [compiled.block_names[block] for block in compiled.program.framed_contacts]
    raw = outcome.contact_forces.reshape(nt, len(names), 3)
    places = _places(compiled, outcome, points)
    forces, torques = {}, {}
    for name, resultant in Groups(names, compiled.contact_of).slices().items():
        forces[name], torques[name] = raw[:, resultant.start], np.zeros((nt, 3))
        if name in compiled.points and points is not None:
            columns = points.of(name)
            parts, loads = points.forces[:, columns], points.loads[:, columns]
            levers = places[:, columns] - centers(loads, places[:, columns], 0.0)[:, None]
            forces[name] = parts.sum(axis=1)
            torques[name] = np.cross(levers, parts).sum(axis=1)
    return {"contact_forces": forces, "contact_torques": torques}


def centers(loads: Array, places: Array, missing: float = np.nan) -> Array:
    """Return the mean of points weighted by their normal forces, (nt, 3).

    Args:
        loads: normal forces [N], (nt, n).
        places: positions of the points [m], (nt, n, 3).
        missing: value without a normal force.
    """
    total = loads.sum(axis=1)[:, None]
    weighted = np.einsum("ik,ikj->ij", loads, places)
    return np.asarray(np.divide(weighted, total, out=np.full(weighted.shape, missing), where=total != 0.0))


def reactions(
    compiled: CompiledScene, outcome: core.Outcome, points: PointSamples | None
) -> dict[str, Array]:
    """Return the wrenches of joints, then of anchors and contacts, in their own axes and in world axes.

    Args:
        compiled: compiled scene of the run.
        outcome: result of the core.
        points: samples of the points of pairs of shapes.
    """
    joints = [str(name) for name in compiled.model.names][1:]
    names = [compiled.block_names[block] for block in compiled.program.reaction_blocks]
    raw = outcome.reactions.reshape(len(outcome.t), len(joints) + len(names), WRENCH)
    table = {name: raw[:, k] for k, name in enumerate(joints)}
    groups = Groups(names, compiled.contact_of)
    table |= {name: raw[:, len(joints) + k] for name, k in zip(groups.names, groups.starts, strict=True)}
    if points is not None:
        places = _places(compiled, outcome, points)
        table |= {name: _wrench(compiled, outcome, points, places, name) for name in compiled.points}
    return table


def _places(compiled: CompiledScene, outcome: core.Outcome, points: PointSamples | None) -> Array:
    """Return the positions of points in the world [m], (nt, n, 3)."""
    if points is None:
        return np.zeros((len(outcome.t), 0, 3))
    if points.places is not None:
        return points.places
    q = np.ascontiguousarray(outcome.q.reshape(len(outcome.t), compiled.model.nq))
    return contact_lines(compiled, q, outcome.t, points.names)[0]


def _wrench(
    compiled: CompiledScene, outcome: core.Outcome, points: PointSamples, places: Array, name: str
) -> Array:
    """Return the wrench of a pair of shapes on its first body, about the origin of its joint, (nt, 12).

    The joint of the second body gives the own axes.
    """
    model, nt, columns = compiled.model, len(outcome.t), points.of(name)
    if not columns:
        return np.zeros((nt, WRENCH))
    bodies = contact_bodies(compiled, name)
    q, v = outcome.q.reshape(nt, model.nq), outcome.v.reshape(nt, model.nv)
    origin = frame_motion(model, str(model.names[bodies.joint]), q, v)[0]
    forces = points.forces[:, columns]
    force, moment = forces.sum(axis=1), np.cross(places[:, columns] - origin[:, None], forces).sum(axis=1)
    if bodies.other:
        axes = frame_motion(model, str(model.names[bodies.other]), q, v)[1]
        own = [np.einsum("kji,kj->ki", axes, x) for x in (force, moment)]
    else:
        own = [force, moment]
    return np.hstack([*own, force, moment])
