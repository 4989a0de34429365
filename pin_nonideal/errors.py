"""The exceptions of pin_nonideal.

Every error derives from `PinNonidealError` and from the built-in exception that a caller expects
(`ValueError`, `KeyError`, `RuntimeError`, `OSError`). A message has three parts: the requirement, the given
value, and a remedy.
"""

from __future__ import annotations

import reprlib
from collections.abc import Iterable
from typing import Any

MESSAGE_MAX = 1000  # characters of a message
MESSAGE_END = 300  # characters at the end of a longer message that stay, since they hold the remedy
VALUE_MAX = 160  # characters of a value in a message
NAME_MAX = 64  # characters of a name that is compared with known names


class PinNonidealError(Exception):
    """Base class of all errors raised by this package."""

    def __reduce__(self) -> tuple[object, ...]:
        # The constructor cannot be used, since its arguments differ from `args`.
        return _rebuild_error, (type(self), self.args, dict(self.__dict__))

    def __str__(self) -> str:
        # KeyError prints the repr of its message; all classes here print the message itself.
        return _shorten(str(self.args[0]), MESSAGE_MAX, MESSAGE_END) if self.args else ""


def _rebuild_error(
    kind: type[PinNonidealError], args: tuple[object, ...], state: dict[str, object]
) -> PinNonidealError:
    """Rebuild an error from another process."""
    error = kind.__new__(kind, *args)
    error.args = args
    error.__dict__.update(state)
    return error


class InputError(PinNonidealError, ValueError):
    """An argument has a wrong shape, unit, sign or value."""


class UnknownNameError(PinNonidealError, KeyError):
    """A frame, joint, robot, key or method of that name does not exist."""


class LoadingError(PinNonidealError, ValueError):
    """A file cannot be turned into a scene."""


class OutputError(PinNonidealError, OSError):
    """A file cannot be written or read back."""


class JointOrderWarning(UserWarning):
    """A list of joint values was read in the order of the model, which differs from the robot's file."""


class RunError(PinNonidealError, RuntimeError):
    """A run stopped early.

    The page "Why did my run stop" (docs/how_to/stopped_runs.md) treats each subclass.

    Attributes:
        trajectory: samples before the failure (`pin_nonideal.Trajectory`), or None outside of a run.
        time: time of the failure [s], or None.
        index: index of the run in a rollout, or None.
        results: Trajectory or error of each run of a rollout; None outside of a rollout.
    """

    def __init__(self, message: str, *, time: float | None = None) -> None:
        super().__init__(message)
        self.time = time
        self.trajectory: Any = None
        self.index: int | None = None
        self.results: list[Any] | None = None


class SingularMassError(RunError, ValueError):
    """The mass matrix M(q) is not positive definite (massless or negative links)."""


class InconsistentConstraintsError(RunError):
    """Constraints contradict each other: no acceleration satisfies A a = b."""


class LoopClosureError(RunError):
    """No configuration near the given one satisfies the holonomic constraints.

    Attributes:
        gaps: remaining gap of each constraint by name [m or rad].
    """

    def __init__(self, message: str, *, gaps: dict[str, float], time: float | None = None) -> None:
        super().__init__(message, time=time)
        self.gaps = gaps


class NonFiniteError(RunError):
    """A state, force or acceleration became infinite or not a number."""


class FrictionParadoxError(RunError):
    """The friction law and the dynamics have no common solution, or several (Painleve's paradox).

    Attributes:
        time: time of the paradox [s].
        element: name of the friction element, or names joined by commas.
        determinant: det(I - d lam' / d lam) of the implicit reaction equation, smallest over its solutions.
        solutions: accelerations (nv,) of two motions that satisfy all laws; empty without a solution or if
            they are unknown.
        limits: friction limits of the elements in each motion [N m or N].
    """

    def __init__(
        self,
        message: str,
        *,
        element: str,
        determinant: float,
        time: float | None = None,
        solutions: Iterable[object] = (),
        limits: Iterable[object] = (),
    ) -> None:
        super().__init__(message, time=time)
        self.element = element
        self.determinant = determinant
        self.solutions = tuple(solutions)
        self.limits = tuple(limits)


class FrictionConvergenceError(RunError):
    """The solver found no consistent stick-slip modes; a solution may still exist.

    Attributes:
        time: time of the failure [s].
        element: name of the friction element at rest, or names joined by commas.
    """

    def __init__(self, message: str, *, element: str, time: float | None = None) -> None:
        super().__init__(message, time=time)
        self.element = element


class ImpactEnergyError(RunError):
    """An impact gained energy, as Newton's law of restitution with friction may.

    Attributes:
        element: name of the contact, or names joined by commas.
        gain: energy gained [J].
    """

    def __init__(self, message: str, *, element: str, gain: float, time: float | None = None) -> None:
        super().__init__(message, time=time)
        self.element = element
        self.gain = gain


class StepSizeError(RunError):
    """The tolerance requires too short steps, or the run has reached its maximum number of steps."""


class EquilibriumError(RunError):
    """No equilibrium was found."""


class WallTimeError(RunError):
    """The run has reached its maximum wall time."""


class StiffnessError(StepSizeError):
    """Stability, not accuracy, limits the steps of an explicit method.

    Attributes:
        joint: name of the joint with the stiff force.
        rate: relaxation rate [1/s].
    """

    def __init__(self, message: str, *, joint: str, rate: float, time: float | None = None) -> None:
        super().__init__(message, time=time)
        self.joint = joint
        self.rate = rate


class DivergenceError(RunError):
    """Speeds grow without bound, over many decades: the motion is unstable.

    Attributes:
        joint: name of the fastest joint.
        source: names of the actuation, forces or laws that do most work on the motion.
        rate: growth rate over the last decades [1/s].
    """

    def __init__(
        self, message: str, *, joint: str, source: str, rate: float, time: float | None = None
    ) -> None:
        super().__init__(message, time=time)
        self.joint = joint
        self.source = source
        self.rate = rate


class UserFunctionError(RunError):
    """A user function raised, or returned a value of wrong shape or not finite."""


class RunInterrupted(RunError, KeyboardInterrupt):
    """Ctrl-C stopped the run; `trajectory` holds the samples before the stop."""


def nearest(name: str, names: Iterable[str]) -> str:
    """Return a message suffix with the closest known name, for unknown names.

    A name is close if at most one letter in three is changed, added, left out or swapped with its neighbor,
    or if one name begins with the other.

    Args:
        name: the unknown name.
        names: known names.

    Returns:
        `; nearest: "..."` or, if no name is close, `; known: ...` with up to eight names.
    """
    import difflib

    known = list(dict.fromkeys(names))
    if len(name) <= NAME_MAX:
        for close in difflib.get_close_matches(name, known, n=3, cutoff=0.5):
            if _is_close(name, close):
                return f'; nearest: "{close}"'
    if not known:
        return "; there is none"
    shown = ", ".join(f'"{_shorten(n, NAME_MAX)}"' for n in known[:8])
    return f"; known: {shown}" + (", ..." if len(known) > 8 else "")


def short_repr(value: object) -> str:
    """Return the repr of a value for a message, with long parts left out.

    Args:
        value: any object, also one whose `__repr__` raises.

    Returns:
        The repr, or a part of it of at most `VALUE_MAX` characters.
    """
    try:
        text = repr(value)
    except Exception:
        return f"<{type(value).__name__}>"
    if len(text) <= VALUE_MAX:
        return text
    if type(value) in (list, tuple, dict, set, frozenset):
        text = _parts.repr(value)
    return _shorten(text, VALUE_MAX, VALUE_MAX // 4)


_parts = reprlib.Repr()
_parts.maxlist = _parts.maxtuple = _parts.maxdict = _parts.maxset = _parts.maxfrozenset = 3
_parts.maxlevel, _parts.maxstring, _parts.maxother = 3, 30, 30


def _shorten(text: str, max_length: int, end: int = 0) -> str:
    """Return a text, or its beginning and its last `end` characters around " ... "."""
    if len(text) <= max_length:
        return text
    return f"{text[: max_length - end - 5]} ... {text[len(text) - end :]}".rstrip()


def _is_close(name: str, known: str) -> bool:
    """Check if a name is a known name with few changes."""
    a, b = name.casefold(), known.casefold()
    short = min(a, b, key=len)
    if len(short) >= 3 and a[: len(short)] == b[: len(short)]:
        return True
    return _edits(a, b) <= max(1, max(len(a), len(b)) // 3)


def _edits(a: str, b: str) -> int:
    """Return the number of letters changed, added, left out or swapped with a neighbour between two words."""
    before: list[int] = []
    last = list(range(len(b) + 1))
    for i, x in enumerate(a, 1):
        row = [i]
        for j, y in enumerate(b, 1):
            row.append(min(last[j] + 1, row[j - 1] + 1, last[j - 1] + (x != y)))
            if i > 1 and j > 1 and x == b[j - 2] and a[i - 2] == y:
                row[j] = min(row[j], before[j - 2] + 1)
        before, last = last, row
    return last[-1]
