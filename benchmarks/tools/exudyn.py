"""Exudyn: a kinematic tree in minimal coordinates with compiled Runge-Kutta methods."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from .base import Outcome, Setting, needs, tolerances

# Minimum step relative to the duration: below it, rounding limits step control and runs take hours.
SMALLEST_STEP = 1e-6


class Exudyn:
    """Exudyn for trees of revolute joints only; loops would need its redundant formulations."""

    name = "exudyn"
    title = "Exudyn"

    def missing(self) -> str | None:
        """Return the reason why the tool cannot run, or None."""
        return needs("exudyn")

    def settings(self, problem: Any) -> list[Setting]:
        """Return the settings to try."""
        revolute = all(
            j.shortname() in ("JointModelRX", "JointModelRY", "JointModelRZ")
            for j in problem.model.joints[1:]
        )
        extras = (problem.hold, problem.coulomb, problem.viscous, problem.torque)
        if not revolute or problem.anchors or problem.springs or any(extra is not None for extra in extras):
            return []
        adaptive = [Setting("DOPRI5", f"tol {tol:.0e}", values={"rtol": tol}) for tol in tolerances(3, 12)]
        steps = [round(problem.duration / h) for h in (0.02, 0.01, 5e-3, 2.5e-3, 1e-3, 5e-4, 2e-4)]
        fixed = [Setting("RK67", f"h {problem.duration / n:.1e}", n) for n in steps]
        return adaptive + fixed

    def prepare(self, problem: Any, setting: Setting, samples: int = 1) -> Callable[[], Outcome]:
        """Return a function that runs the problem once from its start."""
        import exudyn

        mbs = tree(exudyn, problem)
        settings = exudyn.SimulationSettings()
        integration = settings.timeIntegration
        integration.verboseMode = 0
        integration.explicitIntegration.computeEndOfStepAccelerations = False
        settings.solutionSettings.writeSolutionToFile = False
        settings.solutionSettings.sensorsWritePeriod = 2.0 * problem.duration
        method = getattr(exudyn.DynamicSolverType, setting.family)
        if setting.steps is None:
            integration.automaticStepSize = True
            integration.relativeTolerance = integration.absoluteTolerance = setting.values["rtol"]
            integration.initialStepSize = 1e-3
            integration.minimumStepSize = SMALLEST_STEP * problem.duration
        else:
            integration.automaticStepSize = False
        initial = exudyn.ConfigurationType.Initial
        q0, v0 = np.array(problem.q0), np.array(problem.v0)

        def run_to(end: float, steps: int | None) -> Outcome:
            integration.endTime = end
            integration.numberOfSteps = steps or 1  # adaptive: no maximum step
            mbs.systemData.SetODE2Coordinates(q0, configuration=initial)
            mbs.systemData.SetODE2Coordinates_t(v0, configuration=initial)
            try:
                done = mbs.SolveDynamic(settings, solverType=method)
            except Exception as error:  # its exceptions have no common base class
                return Outcome(None, 0, failure=str(error).splitlines()[0])
            made = int(mbs.sys["dynamicSolver"].it.currentStepIndex) - 1
            if done is False:
                return Outcome(None, made, steps, failure="the solver gave up")
            q, v = mbs.systemData.GetODE2Coordinates(), mbs.systemData.GetODE2Coordinates_t()
            return Outcome(np.array(q)[None, :], made, steps, v=np.array(v))

        def run() -> Outcome:
            """Run the problem once for each sample: adaptive steps stop at the end of a run only."""
            outcome, found = Outcome(None, 0), []
            for k in range(1, samples + 1):
                steps = None if setting.steps is None else setting.steps * k // samples
                outcome = run_to(problem.duration * k / samples, steps)
                if outcome.q is None:
                    return outcome
                found.append(outcome.q[0])
            return replace(outcome, q=np.array(found))

        return run


def tree(exudyn: Any, problem: Any) -> Any:
    """Return the problem's model as one kinematic tree."""
    from exudyn.itemInterface import NodeGenericODE2, ObjectKinematicTree

    model = problem.model
    n = model.nv
    joints = range(1, model.njoints)
    mbs = exudyn.SystemContainer().AddSystem()
    node = mbs.AddNode(NodeGenericODE2(
        referenceCoordinates=[0.0] * n, initialCoordinates=problem.q0.tolist(),
        initialCoordinates_t=problem.v0.tolist(), numberOfODE2Coordinates=n,
    ))  # fmt: skip
    kinds = {f"JointModelR{axis}": getattr(exudyn.JointType, f"Revolute{axis}") for axis in "XYZ"}
    places = [model.jointPlacements[i] for i in joints]
    bodies = [model.inertias[i] for i in joints]
    mbs.AddObject(ObjectKinematicTree(
        nodeNumber=node,
        gravity=np.array(model.gravity.linear).tolist(),
        jointTypes=[kinds[model.joints[i].shortname()] for i in joints],
        linkParents=[model.parents[i] - 1 for i in joints],
        jointTransformations=exudyn.Matrix3DList([place.rotation for place in places]),
        jointOffsets=exudyn.Vector3DList([place.translation for place in places]),
        linkInertiasCOM=exudyn.Matrix3DList([body.inertia for body in bodies]),
        linkCOMs=exudyn.Vector3DList([body.lever for body in bodies]),
        linkMasses=[body.mass for body in bodies],
    ))  # fmt: skip
    mbs.Assemble()
    return mbs
