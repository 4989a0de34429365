"""Decoupled components of a scene: mechanisms without a common joint, row or load.

Each component is a separate compiled scene. The components of a scene are computed once and cached.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from pin_nonideal.compilation.compiled_scene import CompiledScene
from pin_nonideal.description.actuation import HoldPosition
from pin_nonideal.description.constraints import (
    Distance,
    FrameAnchor,
    HingeAnchor,
    JointCoupling,
    KnifeEdge,
    PointAnchor,
    PrescribedMotion,
)
from pin_nonideal.description.forces import JointSpring, SpringDamper, Wrench
from pin_nonideal.description.laws import Drag, JointFriction, SigmoidFriction
from pin_nonideal.states.parsing import named_configuration
from pin_nonideal.types import Model, Table

Indices = NDArray[np.intp]
# Descriptions that act only on the bodies that they name.
LOCAL_DESCRIPTIONS = (
    *(PointAnchor, FrameAnchor, HingeAnchor, Distance, JointCoupling, PrescribedMotion, KnifeEdge),
    *(JointFriction, SigmoidFriction, Drag, SpringDamper, JointSpring, Wrench),
)
PLACES = ("frame", "frame1", "frame2", "joint", "joint1", "joint2")


@dataclass(frozen=True, eq=False)
class Component:
    """A mechanism of a scene that is decoupled from the others.

    Attributes:
        compiled: the mechanism as a separate compiled scene.
        q: indices of its coordinates in the configuration of the whole scene, (nq,).
        v: indices of its coordinates in the velocity of the whole scene, (nv,).
        elements: indices of its friction elements in the whole scene, (ne,).
        works: indices of its work columns in the whole scene.
    """

    compiled: CompiledScene
    q: Indices
    v: Indices
    elements: Indices
    works: Indices


def components(compiled: CompiledScene) -> list[Component]:
    """Return the decoupled mechanisms of a scene with dry friction; empty if there is only one.

    Scenes with contacts, states of laws or global descriptions count as one mechanism.

    Args:
        compiled: the compiled whole scene, which holds the components.
    """
    parts: list[Component] | None = compiled.__dict__.get("_components")
    if parts is None:
        parts = compiled.__dict__["_components"] = _components(compiled)
    return parts


def _components(compiled: CompiledScene) -> list[Component]:
    model, spec, held = compiled.model, compiled.spec, compiled.spec.actuation
    by_position = isinstance(held, HoldPosition) and isinstance(held.kp, float) and isinstance(held.kd, float)
    descriptions = [*spec.constraints, *spec.laws, *spec.forces]
    whole = (
        not compiled.elements.names
        or compiled.program.states
        or spec.contacts
        or not (held is None or by_position)
        or any(type(one) not in LOCAL_DESCRIPTIONS for one in descriptions)
        or sum(parent == 0 for parent in list(model.parents)[1:]) < 2
    )
    if whole:
        return []
    tree = _trees(model)
    anchors = dict(zip(compiled.multipliers.slices, spec.constraints, strict=False))
    touched = [_tree_roots(one, model, tree, anchors) for one in descriptions]
    group = {root: root for root in tree[1:]}
    for roots in touched:
        joined = {group[root] for root in roots}
        group = {root: min(joined) if of in joined else of for root, of in group.items()}
    if len(set(group.values())) < 2 or not all(touched):
        return []
    own = [group[min(roots)] for roots in touched]
    return [
        _component(
            compiled,
            [joint for joint, root in enumerate(tree) if group.get(root) == of],
            [one for one, each in zip(descriptions, own, strict=True) if each == of],
        )
        for of in sorted(set(group.values()))
    ]


def _trees(model: Model) -> list[int]:
    """Return the root joint of each joint's tree."""
    tree = [0]
    for joint, parent in enumerate(list(model.parents)[1:], 1):
        tree.append(tree[parent] if parent else joint)
    return tree


def _tree_roots(one: Any, model: Model, tree: Sequence[int], anchors: Table) -> set[int]:
    """Return the root joints of the trees that a description acts on."""
    roots: set[int] = set()
    for place in (f.name for f in fields(one) if f.name in PLACES):
        name = getattr(one, place)
        if name is None:
            continue
        if place.startswith("joint") and model.existJointName(name):
            roots.add(tree[model.getJointId(name)])
        elif model.existFrame(name):
            roots.add(tree[model.frames[model.getFrameId(name)].parentJoint])
        elif is_dataclass(anchors.get(name)):
            roots |= _tree_roots(anchors[name], model, tree, {})
    return roots - {0}


def _component(compiled: CompiledScene, joints: Sequence[int], own: Sequence[Any]) -> Component:
    """Return the component of some joints and of the descriptions that act on them."""
    model, q, v = _separate_model(compiled.model, joints)
    spec, held = compiled.spec, compiled.spec.actuation
    if isinstance(held, HoldPosition) and held.q is not None:
        held = replace(held, q=named_configuration(compiled.model, held.q, compiled.q0, "q")[q])
    parts: Table = {
        kind: tuple(one for one in getattr(spec, kind) if any(one is each for each in own))
        for kind in ("constraints", "laws", "forces")
    }
    part = CompiledScene(model, compiled.q0[q], spec._replace(**parts, actuation=held))
    elements = [compiled.elements.names.index(name) for name in part.elements.names]
    works = [compiled.program.power_names.index(name) for name in part.program.power_names]
    return Component(part, q, v, np.array(elements, dtype=np.intp), np.array(works, dtype=np.intp))


def _separate_model(model: Model, joints: Sequence[int]) -> tuple[Model, Indices, Indices]:
    """Return some trees of a model as a separate model, and the indices of its q and v in the whole model."""
    component_model, number = pin.Model(), {0: 0}
    component_model.name, component_model.gravity = model.name, model.gravity
    q: list[int] = []
    v: list[int] = []
    for joint in joints:
        kind = model.joints[joint]
        at_q, at_v = slice(kind.idx_q, kind.idx_q + kind.nq), slice(kind.idx_v, kind.idx_v + kind.nv)
        number[joint] = component_model.addJoint(
            number[model.parents[joint]], kind, model.jointPlacements[joint], model.names[joint]
        )
        component_model.appendBodyToJoint(number[joint], model.inertias[joint], pin.SE3.Identity())
        added = component_model.joints[number[joint]]
        to_q, to_v = slice(added.idx_q, added.idx_q + added.nq), slice(added.idx_v, added.idx_v + added.nv)
        for name in ("lowerPositionLimit", "upperPositionLimit"):
            getattr(component_model, name)[to_q] = getattr(model, name)[at_q]
        for name in ("armature", "rotorInertia", "rotorGearRatio", "damping", "friction"):
            if hasattr(model, name):
                getattr(component_model, name)[to_v] = getattr(model, name)[at_v]
        q.extend(range(at_q.start, at_q.stop))
        v.extend(range(at_v.start, at_v.stop))
    for frame in list(model.frames)[1:]:
        if frame.parentJoint in number and not component_model.existFrame(frame.name, frame.type):
            joint = number[frame.parentJoint]
            component_model.addFrame(pin.Frame(frame.name, joint, 0, frame.placement, frame.type), False)
    return component_model, np.array(q, dtype=np.intp), np.array(v, dtype=np.intp)
