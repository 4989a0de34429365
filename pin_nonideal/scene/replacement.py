"""Replacement of parts of a scene, and the configuration with its robot on the ground."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import pinocchio as pin

from pin_nonideal.compilation.compiled_scene import CompiledScene
from pin_nonideal.compilation.resolver import unique_names
from pin_nonideal.description.contacts.point_names import UsedNames
from pin_nonideal.errors import InputError, UnknownNameError, nearest
from pin_nonideal.geometry.ground import lowest_height
from pin_nonideal.states.held_entries import Held
from pin_nonideal.states.kinematics import frame_index, joint_placements
from pin_nonideal.states.parsing import named_coordinates, named_entries
from pin_nonideal.types import Array, Model, Placement, State, Table
from pin_nonideal.validation import sequence

from .state import SceneStates

KINDS = ("constraints", "laws", "contacts", "forces")


class UnchangedType:
    """Default of an argument that keeps its present value."""

    def __repr__(self) -> str:
        return "unchanged"


UNCHANGED = UnchangedType()


def parts_after(
    compiled: CompiledScene, new: Table, added: Table, remove: Iterable[str]
) -> dict[str, tuple[object, ...]]:
    """Return the descriptions of a scene after a replacement, by kind.

    Args:
        compiled: the scene before.
        new: lists that replace the lists of the scene, by kind; None keeps a list.
        added: lists that are appended, by kind.
        remove: names of descriptions to leave out.

    Raises:
        InputError: an argument is not a list of descriptions.
        UnknownNameError: there is no description of a name in `remove`.
    """
    spec = compiled.spec
    now: dict[str, tuple[object, ...]] = {kind: tuple(getattr(spec, kind)) for kind in KINDS}
    names = dict(
        zip(("laws", "forces"), (unique_names(now[k], UsedNames()) for k in ("laws", "forces")), strict=True)
    )
    used_names = UsedNames()
    names |= {kind: unique_names(now[kind], used_names) for kind in ("constraints", "contacts")}
    leave = set(sequence("replace: remove", remove))
    known = [name for kind in KINDS for name in names[kind]]
    for name in leave:
        if name not in known:
            raise UnknownNameError(
                f'replace: no constraint, law, contact or force "{name}" to remove{nearest(str(name), known)}'
            )
    after = {}
    for kind in KINDS:
        remaining = [one for one, name in zip(now[kind], names[kind], strict=True) if name not in leave]
        first = remaining if new[kind] is None else sequence(f"replace: {kind}", new[kind])
        after[kind] = (*first, *sequence(f"replace: add_{kind}", added[kind]))
    return after


def parts_of_replacement(
    parts: Table,
    compiled: CompiledScene,
    states: SceneStates,
    lists: Table,
    added: Table,
    remove: Iterable[str],
    others: Table,
) -> Table:
    """Return the parts of a scene, as `copying.parts_of` does, after `Scene.replace`.

    Args:
        parts: parts of the scene before the replacement.
        compiled: the compiled scene before the replacement.
        states: states of the scene before the replacement.
        lists: lists that replace the lists of the scene, by kind; None keeps a list.
        added: lists that are appended, by kind.
        remove: names of descriptions to leave out.
        others: new actuation, or UNCHANGED; new "q0", "v0" and "name", or None for the present ones.

    Raises:
        InputError: an argument is not a list of descriptions, or a state does not fit the model.
        UnknownNameError: there is no description of a name in `remove`.
    """
    arguments = parts["made"] | parts_after(compiled, lists, added, remove)
    if not isinstance(others["actuation"], UnchangedType):
        arguments["actuation"] = others["actuation"]
    if others["q0"] is not None:
        arguments["q0"] = states.configuration(others["q0"], "replace: q0")
    if others["v0"] is not None:
        arguments["v0"] = states.velocity(others["v0"], "replace: v0")
    if others["name"] is not None:
        arguments["name"] = others["name"]
    later = parts["later"] | {"table": None}
    later["held"] = held_entries(compiled.model, states.held, others["q0"], others["v0"])
    return parts | {"made": arguments, "later": later}


def held_entries(model: Model, held: Held, q0: State | None, v0: State | None) -> Held:
    """Return the entries of the initial state that its user names, after a replacement.

    Args:
        model: pinocchio.Model.
        held: named entries before the replacement.
        q0: the new initial configuration, or None.
        v0: the new initial velocity, or None.
    """
    return Held(
        held.q if q0 is None else named_coordinates(model, q0),
        held.v if v0 is None else named_entries(model, v0),
    )


def on_ground(model: Model, shapes: object, q: Array, plane: str | None) -> Array:
    """Configuration with the floating trees moved along a plane's normal until a shape touches it, (nq,).

    Args:
        model: pinocchio.Model.
        shapes: pinocchio.GeometryModel for collisions, or None.
        q: configuration before, (nq,).
        plane: name of a frame on the world, whose third axis is the normal; None for the ground z = 0.

    Raises:
        InputError: the robot has no floating base or no shapes, or the plane moves.
        UnknownNameError: there is no such frame.
    """
    if shapes is None:
        raise InputError(
            f'put_on_ground: model "{model.name}" has no collision shapes; give collision_model='
        )
    roots = [
        j
        for j in range(1, model.njoints)
        if model.parents[j] == 0 and model.joints[j].shortname() == "JointModelFreeFlyer"
    ]
    if not roots:
        raise InputError(f'put_on_ground: model "{model.name}" has no floating base to move')
    place = _plane(model, q, plane)
    height = lowest_height(model, shapes, q, place)
    moved = np.array(q)
    for j in roots:
        shift = model.jointPlacements[j].rotation.T @ (height * place.rotation[:, 2])
        moved[model.idx_qs[j] : model.idx_qs[j] + 3] -= shift
    return moved


def _plane(model: Model, q: Array, name: str | None) -> Placement:
    if name is None:
        return pin.SE3.Identity()
    known: Sequence[str] = [str(frame.name) for frame in model.frames]
    if name not in known:
        raise UnknownNameError(f'put_on_ground: no frame "{name}"{nearest(str(name), known)}')
    frame = model.frames[frame_index(model, name)]
    if frame.parentJoint:
        raise InputError(
            f'put_on_ground: plane "{name}" must be a frame on the world; it is on a moving body'
        )
    return joint_placements(model, q)[0] * frame.placement
