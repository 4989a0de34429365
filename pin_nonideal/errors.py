"""The exceptions of pin_nonideal.

Every error derives from `PinNonidealError` and from the built-in exception that a caller expects
(`ValueError`, `KeyError`, `RuntimeError`, `OSError`). A message has three parts: the requirement, the given
value, and a remedy.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any


class PinNonidealError(Exception):
    """Root of all errors raised by this package."""

    def __reduce__(self) -> tuple[Any, ...]:
        # The constructor cannot be used, since its arguments differ from `args`.
        return _made_again, (type(self), self.args, dict(self.__dict__))

    def __str__(self) -> str:
        # KeyError prints the repr of its message; all classes here print the message itself.
        return str(self.args[0]) if self.args else ""


def _made_again(
    kind: type[PinNonidealError], args: tuple[Any, ...], state: dict[str, Any]
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
        solutions: Iterable[Any] = (),
        limits: Iterable[Any] = (),
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

    Args:
        name: the unknown name.
        names: known names.

    Returns:
        `; nearest: "..."` or, if no name is close, `; known: ...` with up to eight names.
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
