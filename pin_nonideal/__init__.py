"""Pinocchio robots with loops, contacts and friction: the explicit equation of constrained motion, simulated.

    scene = pn.load("four_bar")
    run = pn.simulate(scene, duration=5.0)
    pn.replay(run, "four_bar.html")

Names and units follow Pinocchio and the paper; see docs/theory.md for both.
"""

from __future__ import annotations

from . import actuation, constraints, contacts, forces, laws
from .actuation import *
from .constraints import *
from .contacts import *
from .equation import Solution, solve
from .errors import (
    FrictionConvergenceError,
    FrictionParadoxError,
    InconsistentConstraintsError,
    InputError,
    LoadingError,
    LoopClosureError,
    NonFiniteError,
    OutputError,
    PinNonidealError,
    RunError,
    RunInterrupted,
    SingularMassError,
    StepSizeError,
    StiffnessError,
    UnknownNameError,
    UserFunctionError,
)
from .forces import *
from .laws import *
from .loading import load, robots
from .plotting import plot
from .records import LawRecord
from .replay import replay
from .runs.resume import resume
from .scene import Scene
from .simulation import rollout, simulate
from .sweep import sweep
from .timefunctions import constant, polynomial, sinusoid, spline
from .trajectory import Event, Stats, Trajectory
from .version import __version__ as __version__

__all__ = [
    "Event",
    "FrictionConvergenceError",
    "FrictionParadoxError",
    "InconsistentConstraintsError",
    "InputError",
    "LawRecord",
    "LoadingError",
    "LoopClosureError",
    "NonFiniteError",
    "OutputError",
    "PinNonidealError",
    "RunError",
    "RunInterrupted",
    "Scene",
    "SingularMassError",
    "Solution",
    "Stats",
    "StepSizeError",
    "StiffnessError",
    "Trajectory",
    "UnknownNameError",
    "UserFunctionError",
    "constant",
    "load",
    "plot",
    "polynomial",
    "replay",
    "resume",
    "robots",
    "rollout",
    "simulate",
    "sinusoid",
    "solve",
    "spline",
    "sweep",
]
__all__ += actuation.__all__
__all__ += constraints.__all__
__all__ += contacts.__all__
__all__ += forces.__all__
__all__ += laws.__all__
