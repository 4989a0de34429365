"""Drake: a continuous MultibodyPlant with error-controlled Runge-Kutta methods."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.mjcf_export import mjcf

from .base import Outcome, Setting, needs, tolerances

METHODS = {"RungeKutta3": "runge_kutta3", "RungeKutta5": "runge_kutta5"}
LARGEST_STEP = 0.1  # [s]


class Drake:
    """Drake for trees of revolute joints; it has loops for discrete first-order plants only."""

    name = "drake"
    title = "Drake"

    def missing(self) -> str | None:
        """Return the reason why the tool cannot run, or None."""
        return needs("pydrake")

    def settings(self, problem: Any) -> list[Setting]:
        """Return the settings to try."""
        revolute = all("JointModelR" in j.shortname() for j in problem.model.joints[1:])
        extras = (problem.hold, problem.coulomb, problem.viscous, problem.torque)
        if not revolute or problem.anchors or problem.springs or any(extra is not None for extra in extras):
            return []
        return [
            Setting(family, f"accuracy {goal:.0e}", values={"accuracy": goal})
            for family in METHODS
            for goal in tolerances(2, 13)
        ]

    def prepare(self, problem: Any, setting: Setting, samples: int = 1) -> Callable[[], Outcome]:
        """Return a function that runs the problem once from its start."""
        from pydrake.multibody.parsing import Parser
        from pydrake.multibody.plant import MultibodyPlant
        from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
        from pydrake.systems.framework import DiagramBuilder

        logging.getLogger("drake").setLevel(logging.ERROR)  # warnings on unsupported MJCF tags, all empty
        builder = DiagramBuilder()
        plant = builder.AddSystem(MultibodyPlant(time_step=0.0))
        Parser(plant).AddModelsFromString(mjcf(problem.model, problem.q0), "xml")
        plant.Finalize()
        simulator = Simulator(builder.Build())
        context = simulator.get_mutable_context()
        ResetIntegratorFromFlags(simulator, METHODS[setting.family], LARGEST_STEP)
        integrator = simulator.get_mutable_integrator()
        integrator.set_target_accuracy(setting.values["accuracy"])
        state = plant.GetMyContextFromRoot(context)
        joints = [plant.GetJointByName(name) for name in list(problem.model.names)[1:]]
        places = [joint.position_start() for joint in joints]
        q0, v0 = np.zeros(plant.num_positions()), np.zeros(plant.num_velocities())
        q0[places], v0[places] = problem.q0, problem.v0

        def run() -> Outcome:
            context.SetTime(0.0)
            plant.SetPositions(state, q0)
            plant.SetVelocities(state, v0)
            simulator.Initialize()
            integrator.ResetStatistics()
            found = []
            try:
                for k in range(1, samples + 1):
                    simulator.AdvanceTo(problem.duration * k / samples)
                    found.append(plant.GetPositions(state)[places])
            except RuntimeError as error:
                return Outcome(None, integrator.get_num_steps_taken(), failure=str(error).splitlines()[0])
            v = plant.GetVelocities(state)[places]
            return Outcome(np.array(found), integrator.get_num_steps_taken(), v=v)

        return run
