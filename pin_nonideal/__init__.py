"""Pinocchio robots with loops, contacts and friction: the explicit equation of constrained motion, simulated.

    scene = pn.load("four_bar")
    run = pn.simulate(scene, duration=5.0)
    pn.replay(run, "four_bar.html")

Names and units follow Pinocchio and the paper; see docs/theory.md for both.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from . import actuation, constraints, contacts, forces, laws
from .actuation import *
from .constraints import *
from .contacts import *
from .equation import Solution, solve
from .errors import (
    DivergenceError,
    EquilibriumError,
    FrictionConvergenceError,
    FrictionParadoxError,
    ImpactEnergyError,
    InconsistentConstraintsError,
    InputError,
    JointOrderWarning,
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
    WallTimeError,
)
from .forces import *
from .geometry_contacts import GeometryContact, geometry_contacts
from .laws import *
from .records import Event, FrameRecord, JointRecord, LawRecord, Stats
from .scene import Scene
from .scene_steps import Stepper
from .simulation import simulate
from .states.report import ProjectionReport
from .timefunctions import constant, polynomial, sinusoid, spline
from .trajectory import Trajectory
from .version import __version__ as __version__

if TYPE_CHECKING:
    from .batches import rollout
    from .cones import ConeResiduals, ConeSolution, cone_complementarity
    from .loading import load, robots
    from .plotting import plot
    from .rendering import render
    from .replaying import replay
    from .run_arrays import RunArrays
    from .runs.resume import resume
    from .statics.equilibrium import Equilibrium, equilibrium
    from .statics.inverse_dynamics import InverseDynamics, inverse_dynamics
    from .statics.rest import Rest, rest
    from .sweep_points import sweep_grid, sweep_samples
    from .sweep_store import Sweep
    from .sweeping import sweep

# What not every program asks for is imported when it is asked for.
_LATER = {
    "rollout": "batches",
    "RunArrays": "run_arrays",
    "resume": "runs.resume",
    "load": "loading",
    "robots": "loading",
    "ConeResiduals": "cones",
    "ConeSolution": "cones",
    "cone_complementarity": "cones",
    "plot": "plotting",
    "render": "rendering",
    "replay": "replaying",
    "Equilibrium": "statics.equilibrium",
    "equilibrium": "statics.equilibrium",
    "InverseDynamics": "statics.inverse_dynamics",
    "inverse_dynamics": "statics.inverse_dynamics",
    "Rest": "statics.rest",
    "rest": "statics.rest",
    "sweep_grid": "sweep_points",
    "sweep_samples": "sweep_points",
    "Sweep": "sweep_store",
    "sweep": "sweeping",
}


def __getattr__(name: str) -> Any:
    """A public name whose module has not been imported yet."""
    if name not in _LATER:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value = getattr(import_module(f".{_LATER[name]}", __name__), name)
    return value


def __dir__() -> list[str]:
    """All public names, those that have not been imported yet among them."""
    return sorted([*__all__, "__version__"])


__all__ = [
    "ConeResiduals",
    "ConeSolution",
    "DivergenceError",
    "Equilibrium",
    "EquilibriumError",
    "Event",
    "FrameRecord",
    "FrictionConvergenceError",
    "FrictionParadoxError",
    "GeometryContact",
    "ImpactEnergyError",
    "InconsistentConstraintsError",
    "InputError",
    "InverseDynamics",
    "JointOrderWarning",
    "JointRecord",
    "LawRecord",
    "LoadingError",
    "LoopClosureError",
    "NonFiniteError",
    "OutputError",
    "PinNonidealError",
    "ProjectionReport",
    "Rest",
    "RunArrays",
    "RunError",
    "RunInterrupted",
    "Scene",
    "SingularMassError",
    "Solution",
    "Stats",
    "StepSizeError",
    "Stepper",
    "StiffnessError",
    "Sweep",
    "Trajectory",
    "UnknownNameError",
    "UserFunctionError",
    "WallTimeError",
    "cone_complementarity",
    "constant",
    "equilibrium",
    "geometry_contacts",
    "inverse_dynamics",
    "load",
    "plot",
    "polynomial",
    "render",
    "replay",
    "rest",
    "resume",
    "robots",
    "rollout",
    "simulate",
    "sinusoid",
    "solve",
    "spline",
    "sweep",
    "sweep_grid",
    "sweep_samples",
]
__all__ += actuation.__all__
__all__ += constraints.__all__
__all__ += contacts.__all__
__all__ += forces.__all__
__all__ += laws.__all__
