"""Common checks of contact descriptions, which also convert numbers to floats and tuples."""

from __future__ import annotations

from typing import Any, TypeVar

from pin_nonideal.description.joint_friction import static_ratio
from pin_nonideal.errors import InputError
from pin_nonideal.validation import array, fraction, label, nonnegative, optional_text, text

C = TypeVar("C")


def similar(description: C, **fields: object) -> C:
    """Return a copy of a checked description with other values of some fields, which are not checked again.

    Shapes with many contacts need it: the checks of a description take longer than all else.

    Args:
        description: contact description.
        fields: values by name, in the types that the checks produce.
    """
    copy = object.__new__(type(description))
    vars(copy).update(vars(description), **fields)
    return copy


def check_friction(c: Any, *lengths: str) -> str:
    """Check name, friction, restitution, and nonnegative lengths.

    Args:
        c: the description.
        lengths: names of the fields of lengths.

    Returns:
        Words for messages.
    """
    optional_text(f"{type(c).__name__}: name", c.name)
    who = label(c)
    for key in (*lengths, "mu"):
        object.__setattr__(c, key, nonnegative(f"{who}: {key}", getattr(c, key)))
    object.__setattr__(c, "static_ratio", static_ratio(who, c.static_ratio))
    object.__setattr__(c, "restitution", fraction(f"{who}: restitution", c.restitution))
    return who


def check_two_frames(c: Any, who: str) -> None:
    """Check that the names of both frames differ.

    Args:
        c: the description.
        who: prefix of error messages.

    Raises:
        InputError: the names are equal.
    """
    text(f"{who}: frame1", c.frame1)
    text(f"{who}: frame2", c.frame2)
    if c.frame1 == c.frame2:
        raise InputError(f'{who}: frame1 and frame2 must differ; both are "{c.frame1}"')


def check_vectors(c: object, who: str, *keys: str) -> None:
    """Check fields of three numbers each.

    Args:
        c: the description.
        who: prefix of error messages.
        keys: names of the fields.
    """
    for key in keys:
        object.__setattr__(c, key, tuple(array(f"{who}: {key}", getattr(c, key), (3,)).tolist()))
