"""The exceptions of pin_nonideal.

Every error derives from `PinNonidealError` and from the built-in exception that a caller expects
(`ValueError`, `KeyError`, `RuntimeError`, `OSError`).  A message says what must hold, what came, and what to
do.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any


class PinNonidealError(Exception):
    """Root of all errors raised by this package."""

    def __reduce__(self) -> tuple[Any, ...]:
        # Not by its constructor, which takes other arguments than the message.
        return _made_again, (type(self), self.args, dict(self.__dict__))

    def __str__(self) -> str:
        # KeyError would print the repr of its message; every class here prints the message itself.
        return str(self.args[0]) if self.args else ""


def _made_again(
    kind: type[PinNonidealError], args: tuple[Any, ...], state: dict[str, Any]
) -> PinNonidealError:
    """An error from another process."""
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
    """A list of joints' values was taken in the order of the model, and the robot's file has another one."""


class RunError(PinNonidealError, RuntimeError):
    """A run stopped early.

    Attributes:
        trajectory: what was computed up to the failure (`pin_nonideal.Trajectory`), or None outside of a run.
        time: time of the failure [s], or None.
        index: which state of a rollout it was, or None.
        results: of all runs of the rollout, a Trajectory or the error of each; None outside of one.
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
        element: name of the frictional element, or names joined by commas.
        determinant: det(I - d lam' / d lam) of the implicit reaction equation, the least of its solutions.
        solutions: accelerations (nv,) of two motions that satisfy all laws; empty where there is none, or
            where it is not told.
        limits: friction limits of the elements in each of them [N m or N].
    """

    def __init__(
        self,
        message: str,
        *,
        element: str,
        determinant: float,
        time: float | None = None,
        solutions: Iterable[Any] = (),
        limits: Iterable[Any] = (),
    ) -> None:
        super().__init__(message, time=time)
        self.element = element
        self.determinant = determinant
        self.solutions = tuple(solutions)
        self.limits = tuple(limits)


class FrictionConvergenceError(RunError):
    """Modes of friction at rest were not found, and none of it proves that there are none.

    Attributes:
        time: when it happened [s].
        element: name of the frictional element at rest, or names joined by commas.
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
    """Steps as short as the asked tolerance needs lead nowhere, or the run may take no more of them."""


class EquilibriumError(RunError):
    """No state of rest was found."""


class WallTimeError(RunError):
    """The run may take no more wall time."""


class StiffnessError(StepSizeError):
    """An explicit method crawls: its stability, not the accuracy, keeps the steps short.

    Attributes:
        joint: name of the joint whose force relaxes so fast.
        rate: at which it does [1/s].
    """

    def __init__(self, message: str, *, joint: str, rate: float, time: float | None = None) -> None:
        super().__init__(message, time=time)
        self.joint = joint
        self.rate = rate


class DivergenceError(RunError):
    """Speeds grow without bound, over many decades: the motion is unstable.

    Attributes:
        joint: name of the fastest joint.
        source: the actuation, forces or laws that do most work on the motion, in words.
        rate: of the growth over the last decades [1/s].
    """

    def __init__(
        self, message: str, *, joint: str, source: str, rate: float, time: float | None = None
    ) -> None:
        super().__init__(message, time=time)
        self.joint = joint
        self.source = source
        self.rate = rate


class UserFunctionError(RunError):
    """A function passed by the user raised, or returned a value of wrong shape or not finite."""


class RunInterrupted(RunError, KeyboardInterrupt):
    """Ctrl-C stopped the run; `trajectory` holds what was computed."""


def nearest(name: str, names: Iterable[str]) -> str:
    """Suffix that points at the closest known name, for messages about unknown names.

    Args:
        name: what was asked for.
        names: what exists.

    Returns:
        `; nearest: "..."` or, when nothing is close, `; known: ...` with up to eight names.
    """
    import difflib

    known = list(names)
    close = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    if close:
        return f'; nearest: "{close[0]}"'
    if not known:
        return "; there is none"
    shown = ", ".join(f'"{n}"' for n in known[:8])
    return f"; known: {shown}" + (", ..." if len(known) > 8 else "")
