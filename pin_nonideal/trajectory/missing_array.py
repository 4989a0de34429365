"""Arrays that a run did not record: each use of one raises an error that explains how to record it."""

from __future__ import annotations

from typing import Any, NoReturn

from pin_nonideal.errors import InputError
from pin_nonideal.types import Array, Table

NOT_RECORDED = "was not recorded; pass record={} to simulate"
# Reason why a run does not have an array of a Trajectory.
REASONS = {
    "a": NOT_RECORDED.format('"a"'),
    "tau": NOT_RECORDED.format('"tau" or "forces"'),
    "F_ideal": NOT_RECORDED.format('"forces"'),
    "F_nonideal": NOT_RECORDED.format('"forces"'),
    "lam": NOT_RECORDED.format('"forces"'),
    "lam_ideal": NOT_RECORDED.format('"forces"'),
    "limits": NOT_RECORDED.format('"laws" or "forces"'),
}
# Operators of arrays that a MissingArray refuses.
OPERATORS = (
    *("abs", "add", "array", "call", "contains", "float", "floordiv", "ge", "getitem", "gt", "iter", "le"),
    *("len", "lt", "matmul", "mod", "mul", "neg", "pos", "pow", "radd", "rmatmul", "rmul", "rsub"),
    *("rtruediv", "setitem", "sub", "truediv"),
)


class MissingArray:
    """Array that a run did not record: false in a condition; all other uses raise an InputError.

    Args:
        message: message of the error.
    """

    __slots__ = ("_message",)

    def __init__(self, message: str) -> None:
        self._message = message

    def __bool__(self) -> bool:
        return False

    def __eq__(self, other: object) -> bool:
        return other is None or (isinstance(other, MissingArray) and other._message == self._message)

    def __hash__(self) -> int:
        return hash(self._message)

    def __repr__(self) -> str:
        return f"<{self._message}>"

    def __getattr__(self, name: str) -> NoReturn:
        if name.startswith("__"):  # Python and NumPy ask for protocols such as pickling
            raise AttributeError(name)
        raise InputError(self._message)


def _explain(array: MissingArray, *_: object, **__: object) -> NoReturn:
    raise InputError(repr(array)[1:-1])


for _name in OPERATORS:
    setattr(MissingArray, f"__{_name}__", _explain)


def missing_array(array: str, reason: str) -> Any:
    """Return the stand-in of an array that a run did not record.

    Args:
        array: expression that returns the stand-in, such as "run.a".
        reason: reason why the run does not have the array, as the end of a sentence about it.
    """
    return MissingArray(f"{array} {reason}")


class RunField:
    """Attribute of a Trajectory whose value depends on the field of that name.

    Args:
        field: field of the Trajectory.
    """

    def __init__(self, field: str) -> None:
        self._field = field

    def __get__(self, run: object, owner: object = None) -> Any:
        return self if run is None else self.value(vars(run))

    def value(self, fields: Table) -> object:
        """Return the value of the attribute.

        Args:
            fields: fields of the Trajectory.
        """
        raise NotImplementedError


class ArrayField(RunField):
    """Attribute of a Trajectory that returns an array, or its stand-in if the run did not record it."""

    def value(self, fields: Table) -> Any:
        """Return the array or its stand-in."""
        array = fields[self._field]
        return missing_array(f"run.{self._field}", REASONS[self._field]) if array is None else array

    def __set__(self, run: object, array: Array | None) -> None:
        vars(run)[self._field] = None if isinstance(array, MissingArray) else array
