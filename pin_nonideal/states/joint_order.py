"""Order of a robot's joints in its file, as opposed to the order in the model.

Pinocchio sorts the child joints of a link by name. A list in the order of a URDF would therefore assign
values to other joints. Lists cause a warning; arrays are taken in Pinocchio's order without a warning.
"""

from __future__ import annotations

import sys
import warnings
import weakref
from collections.abc import Sequence
from typing import Literal

from pin_nonideal.errors import JointOrderWarning
from pin_nonideal.types import Model

# Joint names in the order of the file, by `id(model)`, since a pinocchio.Model has no attribute for them.
_file_order: dict[int, tuple[str, ...]] = {}


def remember_order(model: Model, names: Sequence[str]) -> None:
    """Store the joint order of the file for the lifetime of the model, if it differs from the model's order.

    Args:
        model: pinocchio.Model.
        names: joint names in the order of the file; names that the model does not have are ignored.
    """
    model_names = [str(name) for name in model.names][1:]
    filed = [name for name in names if name in model_names]
    if filed != [name for name in model_names if name in filed]:
        _file_order[id(model)] = tuple(filed)
        weakref.finalize(model, _file_order.pop, id(model), None)


def file_order(model: Model) -> tuple[str, ...] | None:
    """Return the joint names in the order of the file, or None if the model has the same order.

    Args:
        model: pinocchio.Model.
    """
    return _file_order.get(id(model))


def order_words(model: Model) -> str | None:
    """Return a message on the two different orders, or None if they agree.

    Args:
        model: pinocchio.Model.
    """
    filed = file_order(model)
    if filed is None:
        return None
    model_names = [str(name) for name in model.names][1:]
    return (
        f"a list is taken in the order of the model ({', '.join(model_names)}), which is not the order of "
        f"the file ({', '.join(filed)})"
    )


def describe_order(model: Model, values: object, what: str, sizes: Literal["nqs", "nvs"]) -> None:
    """Warn if a list of joint values may have been written in the order of the file.

    Args:
        model: pinocchio.Model.
        values: values of all joints.
        what: name of the argument in messages.
        sizes: attribute of the model with the number of values of each joint.
    """
    if not isinstance(values, (list, tuple)):
        return
    if len(values) != sum(getattr(model, sizes)) or file_order(model) is None:
        return
    warnings.warn(
        f"{what}: {order_words(model)}; name the joints, such as {what.split(': ')[-1]}="
        f'{{"{model.names[1]}": ...}}, or pass an array in the order of the model',
        JointOrderWarning,
        stacklevel=find_stack_level(),
    )


def find_stack_level() -> int:
    """Return the stack level of the first caller outside this package."""
    frame, level = sys._getframe(1), 1
    while frame.f_back is not None and str(frame.f_globals.get("__name__", "")).startswith("pin_nonideal"):
        frame, level = frame.f_back, level + 1
    return level
