"""Pinocchio robots with loops, contacts and friction: the explicit equation of constrained motion, simulated.

    scene = pn.load("four_bar")
    run = pn.simulate(scene, duration=5.0)
    pn.replay(run, "four_bar.html")

Names and units follow Pinocchio and the paper; see docs/explanation/equation_of_motion.md for both.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .description import actuation, constraints, contacts, forces, laws
from .description.actuation import *
from .description.constraints import *
from .description.contacts import *
from .description.forces import *
from .description.laws import *
from .description.time_functions import constant, polynomial, sinusoid, spline
from .equation import Solution, solve
from .equation_details import SolutionDetails, solve_details
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
from .geometry.bodies import free_body
from .geometry.from_model import GeometryContact, geometry_contacts, ground_contacts
from .geometry.ground import ground
from .scene.scene import Scene
from .scene.stepping import Stepper
from .simulation.simulate import simulate
from .states.report import ProjectionReport
from .trajectory.records import (
    ContactPoints,
    ContactRecord,
    Event,
    FrameRecord,
    JointRecord,
    LawRecord,
    Stats,
)
from .trajectory.trajectory import Trajectory
from .version import __version__ as __version__

if TYPE_CHECKING:
    from .cone_problems import ConeResiduals, ConeSolution, cone_complementarity
    from .loading.load import load
    from .loading.robot_files import robots
    from .simulation.resume import resume
    from .simulation.rollout import rollout
    from .simulation.rollout_arrays import RunArrays
    from .statics.equilibrium import Equilibrium, equilibrium
    from .statics.holding import HoldingTorque
    from .statics.inverse_dynamics import InverseDynamics, inverse_dynamics
    from .statics.rest import Rest, rest
    from .statics.track_trajectory import TrackTrajectory
    from .sweeps.grid import sweep_grid, sweep_samples
    from .sweeps.store import Sweep
    from .sweeps.sweep import sweep
    from .visualization.plotting import plot
    from .visualization.rendering import render
    from .visualization.replay import replay

# Modules of these names are imported on first use.
_LATER = {
    "rollout": "simulation.rollout",
    "RunArrays": "simulation.rollout_arrays",
    "resume": "simulation.resume",
    "load": "loading.load",
    "robots": "loading.robot_files",
    "ConeResiduals": "cone_problems",
    "ConeSolution": "cone_problems",
    "cone_complementarity": "cone_problems",
    "plot": "visualization.plotting",
    "render": "visualization.rendering",
    "replay": "visualization.replay",
    "Equilibrium": "statics.equilibrium",
    "equilibrium": "statics.equilibrium",
    "HoldingTorque": "statics.holding",
    "InverseDynamics": "statics.inverse_dynamics",
    "inverse_dynamics": "statics.inverse_dynamics",
    "Rest": "statics.rest",
    "rest": "statics.rest",
    "TrackTrajectory": "statics.track_trajectory",
    "sweep_grid": "sweeps.grid",
    "sweep_samples": "sweeps.grid",
    "Sweep": "sweeps.store",
    "sweep": "sweeps.sweep",
}


def __getattr__(name: str) -> Any:
    """Import the module of a public name on first use."""
    if name not in _LATER:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value = getattr(import_module(f".{_LATER[name]}", __name__), name)
    return value


def __dir__() -> list[str]:
    """Return all public names, including names that are not imported yet."""
    return sorted([*__all__, "__version__"])


__all__ = [
    "ConeResiduals",
    "ConeSolution",
    "ContactPoints",
    "ContactRecord",
    "DivergenceError",
    "Equilibrium",
    "EquilibriumError",
    "Event",
    "FrameRecord",
    "FrictionConvergenceError",
    "FrictionParadoxError",
    "GeometryContact",
    "HoldingTorque",
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
    "SolutionDetails",
    "Stats",
    "StepSizeError",
    "Stepper",
    "StiffnessError",
    "Sweep",
    "TrackTrajectory",
    "Trajectory",
    "UnknownNameError",
    "UserFunctionError",
    "WallTimeError",
    "cone_complementarity",
    "constant",
    "equilibrium",
    "free_body",
    "geometry_contacts",
    "ground",
    "ground_contacts",
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
    "solve_details",
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
