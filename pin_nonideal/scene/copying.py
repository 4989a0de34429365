"""Pickling and copying of scenes: a scene is rebuilt from its constructor arguments."""

from __future__ import annotations

import copy
import pickle
from typing import Any

from pin_nonideal.errors import InputError
from pin_nonideal.states.held_entries import Held
from pin_nonideal.states.joint_order import file_order, remember_order
from pin_nonideal.types import Table
from pin_nonideal.validation import label

LISTS = ("constraints", "laws", "contacts", "forces")


class PickledObject:
    """An object serialized by cloudpickle because pickle does not support it, such as a local function.

    Args:
        content: bytes of cloudpickle.
    """

    def __init__(self, content: bytes) -> None:
        self.content = content


def parts_of(
    scene: Any, contacts: tuple[object, ...], source: Any, shapes: tuple[Any, object], held: Held
) -> Table:
    """Return the constructor arguments and the later state of a scene.

    Args:
        scene: the Scene.
        contacts: its contacts, with the manifolds of pairs of shapes, so that no shape is read again.
        source: its Origin.
        shapes: for display and for collisions, or the functions that read them.
        held: entries of the initial state that were named.
    """
    arguments = {
        key: getattr(scene, key)
        for key in (*LISTS, "actuation", "name", "source", "licence", "terms", "impact")
    }
    arguments |= {"contacts": contacts, "q0": scene.q0, "v0": scene.v0}
    arguments["assembly_tolerance"] = source.assembly_tolerance
    arguments |= {"visual_model": shapes[0], "collision_model": shapes[1]}
    later = {"table": source.table, "shapes": source.shapes, "friction": scene.contact_friction, "held": held}
    return {
        "model": scene.model,
        "made": arguments,
        "notes": list(scene.notes),
        "later": later,
        "order": file_order(scene.model),
    }


def rebuilt(kind: type, parts: Table) -> Any:
    """Return a scene rebuilt from its parts, bitwise equal to the original.

    Args:
        kind: Scene, or a class derived from it.
        parts: result of `parts_of`, packed or not.
    """
    arguments = {key: _unpack_object(value) for key, value in parts["made"].items()}
    if parts["order"] is not None:
        remember_order(parts["model"], parts["order"])
    scene = kind(parts["model"], **arguments)
    scene.notes[:] = parts["notes"]
    scene.__setstate__(parts["later"])
    return scene


def copy_scene(scene: Any, parts: Table, memo: dict[int, object]) -> Any:
    """Return a deep copy of a scene with a copy of its model; user functions are shared.

    Args:
        scene: the Scene.
        parts: return value of `parts_of`.
        memo: memo of `copy.deepcopy`.
    """
    shapes = {key: parts["made"].pop(key) for key in ("visual_model", "collision_model")}
    parts["made"] = copy.deepcopy(parts["made"], memo) | shapes  # meshes are shared, since they never change
    parts |= {key: copy.deepcopy(parts[key], memo) for key in ("notes", "later")}
    return rebuilt(type(scene), parts | {"model": scene.model.copy()})


def pack(parts: Table, name: str) -> Table:
    """Return the parts, with cloudpickle applied to objects that pickle does not support.

    Args:
        parts: result of `parts_of`.
        name: name of the scene.

    Raises:
        InputError: a part cannot be pickled; the message names it.
    """
    arguments = dict(parts["made"])
    for key in (*LISTS, "actuation", "visual_model", "collision_model"):
        value = arguments[key]
        if isinstance(value, tuple):
            arguments[key] = tuple(_pack_object(each, label(each), name) for each in value)
        else:
            arguments[key] = _pack_object(value, key, name)
    return {**parts, "made": arguments}


def _pack_object(value: object, what: str, scene: str) -> object:
    if value is None or isinstance(value, str):
        return value
    try:
        pickle.dumps(value)
        return value
    except Exception as error:  # pickle passes on any exception of the object's methods
        reason = f"{type(error).__name__}: {error}"
    advice = "define its functions in a module"
    try:
        import cloudpickle

        return PickledObject(cloudpickle.dumps(value))
    except ImportError:
        advice += ", or pip install cloudpickle"
    except Exception as error:
        reason = f"{reason}; {type(error).__name__}: {error}"
        advice += ", without objects that cannot be pickled"
    raise InputError(f'scene "{scene}" cannot be pickled: {what} cannot ({reason}); {advice}')


def _unpack_object(value: object) -> object:
    if isinstance(value, tuple):
        return tuple(_unpack_object(each) for each in value)
    return pickle.loads(value.content) if isinstance(value, PickledObject) else value
