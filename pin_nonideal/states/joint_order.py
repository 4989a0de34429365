"""The order of a robot's joints in its file, beside the one of its model.

Pinocchio sorts the joints that leave a link by name, so that a list in the order of a URDF would go to
other joints.  Who passes a list is told; arrays are taken as Pinocchio's, without a word.
"""

from __future__ import annotations

import sys
import warnings
import weakref
from collections.abc import Sequence
from typing import Literal

from pin_nonideal.errors import JointOrderWarning
from pin_nonideal.types import Model

# Names in the order of the file, by the model's identity: a model has no place of its own for them.
_file_order: dict[int, tuple[str, ...]] = {}


def remember_order(model: Model, names: Sequence[str]) -> None:
    """Keeps the order of the joints in the file as long as the model lives, where the model has another one.

    Args:
        model: pinocchio.Model.
        names: of joints, in the order of the file; those that the model does not have are passed over.
    """
    own = [str(name) for name in model.names][1:]
    filed = [name for name in names if name in own]
    if filed != [name for name in own if name in filed]:
        _file_order[id(model)] = tuple(filed)
        weakref.finalize(model, _file_order.pop, id(model), None)


def file_order(model: Model) -> tuple[str, ...] | None:
    """Names of the joints in the order of the file, where it differs from the model's; None else.

    Args:
        model: pinocchio.Model.
    """
    return _file_order.get(id(model))


def order_words(model: Model) -> str | None:
    """That the orders differ, and how; None where they do not.

    Args:
        model: pinocchio.Model.
    """
    filed = file_order(model)
    if filed is None:
        return None
    own = [str(name) for name in model.names][1:]
    return (
        f"a list is taken in the order of the model ({', '.join(own)}), which is not the order of the file "
        f"({', '.join(filed)})"
    )


def tell_order(model: Model, given: object, what: str, sizes: Literal["nqs", "nvs"]) -> None:
    """Warns where a list of the joints' values was perhaps written in the order of the file.

    Args:
        model: pinocchio.Model.
        given: values of all joints.
        what: words for messages.
        sizes: which of the model tell how many values each joint has.
    """
    if not isinstance(given, (list, tuple)):
        return
    if len(given) != sum(getattr(model, sizes)) or file_order(model) is None:
        return
    warnings.warn(
        f"{what}: {order_words(model)}; name the joints, such as {what.split(': ')[-1]}="
        f'{{"{model.names[1]}": ...}}, or pass an array to be taken at your word',
        JointOrderWarning,
        stacklevel=find_stack_level(),
    )


def find_stack_level() -> int:
    """How many frames up the caller of this package stands."""
    frame, level = sys._getframe(1), 1
    while frame.f_back is not None and str(frame.f_globals.get("__name__", "")).startswith("pin_nonideal"):
        frame, level = frame.f_back, level + 1
    return level
