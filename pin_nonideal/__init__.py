"""Pinocchio robots with loops, contacts and friction: the explicit equation of constrained motion, simulated.

    scene = pn.load("four_bar")
    run = pn.simulate(scene, duration=5.0)
    pn.replay(run, "four_bar.html")

Names and units follow Pinocchio and the paper; see docs/theory.md for both.
"""

from __future__ import annotations

from .actuation import HoldPosition, SampledControl, Table
from .constraints import (
    Distance,
    FrameAnchor,
    HingeAnchor,
    JointCoupling,
    KnifeEdge,
    PointAnchor,
    PrescribedMotion,
    Rolling,
    UserConstraint,
)
from .contacts import PointContact
from .equation import Solution, solve
from .errors import (
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
    UnknownNameError,
    UserFunctionError,
)
from .forces import JointSpring, SpringDamper, UserForce, Wrench
from .laws import Drag, JointFriction, LuGre, SigmoidFriction, UserFriction, UserLaw
from .loading import load, robots
from .plotting import plot
from .replay import replay
from .runs.resume import resume
from .scene import Scene
from .simulation import rollout, simulate
from .sweep import sweep
from .timefunctions import constant, polynomial, sinusoid, spline
from .trajectory import Event, Stats, Trajectory
from .version import __version__ as __version__

__all__ = [
    "Distance",
    "Drag",
    "Event",
    "FrameAnchor",
    "FrictionParadoxError",
    "HingeAnchor",
    "HoldPosition",
    "InconsistentConstraintsError",
    "InputError",
    "JointCoupling",
    "JointFriction",
    "JointSpring",
    "KnifeEdge",
    "LoadingError",
    "LoopClosureError",
    "LuGre",
    "NonFiniteError",
    "OutputError",
    "PinNonidealError",
    "PointAnchor",
    "PointContact",
    "PrescribedMotion",
    "Rolling",
    "RunError",
    "RunInterrupted",
    "SampledControl",
    "Scene",
    "SigmoidFriction",
    "SingularMassError",
    "Solution",
    "SpringDamper",
    "Stats",
    "StepSizeError",
    "Table",
    "Trajectory",
    "UnknownNameError",
    "UserConstraint",
    "UserForce",
    "UserFriction",
    "UserFunctionError",
    "UserLaw",
    "Wrench",
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
