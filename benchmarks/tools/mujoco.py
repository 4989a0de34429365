"""MuJoCo: its integrators with default soft constraints, and with constraints as stiff as the step allows."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.mjcf_export import mjcf

from .base import Outcome, Setting, needs

Array = NDArray[np.float64]

# Numbers of steps of a run, multiples of the number of samples.
STEPS = (
    50,
    80,
    120,
    200,
    320,
    500,
    800,
    1200,
    2000,
    3200,
    5000,
    8000,
    12_000,
    20_000,
    40_000,
    80_000,
    200_000,
)
INTEGRATORS = {"Euler": "mjINT_EULER", "implicitfast": "mjINT_IMPLICITFAST", "RK4": "mjINT_RK4"}
STIFF_IMPEDANCE = (0.9999, 0.9999, 0.001, 0.5, 2.0)
SOLVER_TOLERANCE = 1e-12


def states(problem: Any) -> Any:
    """Return MuJoCo's model of a problem."""
    import mujoco

    text = mjcf(
        problem.model,
        problem.q0,
        problem.anchors,
        problem.springs,
        problem.hold,
        problem.coulomb,
        problem.viscous,
    )
    mujoco.set_mju_user_warning(lambda text: None)  # divergence is counted instead
    return mujoco.MjModel.from_xml_string(text)


class Coordinates:
    """Map of configurations and velocities between a pinocchio.Model and MuJoCo.

    MuJoCo may have another order of joints. Quaternions of MuJoCo begin with the real part. The linear
    velocity of its free joints is in world axes.
    """

    def __init__(self, model: Any, mj: Any) -> None:
        self.q_places: list[int] = []  # indices of Pinocchio's coordinates in MuJoCo's
        self.v_places: list[int] = []
        self.free: list[tuple[int, int]] = []  # first indices of free joints in q and v
        for i in range(1, model.njoints):
            joint, other = model.joints[i], mj.joint(model.names[i])
            is_free = joint.shortname() == "JointModelFreeFlyer"
            self.q_places += [int(other.qposadr[0]) + k for k in ((0, 1, 2, 4, 5, 6, 3) if is_free else (0,))]
            self.v_places += [int(other.dofadr[0]) + k for k in range(joint.nv)]
            if is_free:
                self.free.append((joint.idx_q, joint.idx_v))

    def there(self, q: Array, v: Array) -> tuple[Array, Array]:
        """Return the state in MuJoCo's coordinates."""
        x, u, v = np.empty_like(q), np.empty_like(v), v.copy()
        for iq, iv in self.free:
            v[iv : iv + 3] = rotation(q, iq) @ v[iv : iv + 3]
        x[self.q_places], u[self.v_places] = q, v
        return x, u

    def back(self, x: Array, u: Array) -> tuple[Array, Array]:
        """Return the state in Pinocchio's coordinates."""
        q, v = x[self.q_places], u[self.v_places]
        for iq, iv in self.free:
            v[iv : iv + 3] = rotation(q, iq).T @ v[iv : iv + 3]
        return q, v


def rotation(q: Array, start: int) -> Array:
    """Return the rotation matrix of the free joint with coordinates from `start`."""
    import pinocchio as pin

    matrix: Array = pin.Quaternion(q[start + 3 : start + 7]).matrix()
    return matrix


def lighten(mj: Any) -> None:
    """Disable features that no problem needs: collisions, limits, islands."""
    import mujoco

    bits = mujoco.mjtDisableBit
    mj.opt.disableflags |= bits.mjDSBL_CONTACT | bits.mjDSBL_LIMIT | bits.mjDSBL_ISLAND


def stiffen(mj: Any, h: float) -> None:
    """Make constraints as stiff as the step h allows: solref 2 h, impedance near 1, tight tolerance."""
    mj.opt.tolerance = SOLVER_TOLERANCE
    mj.eq_solref[:], mj.eq_solimp[:] = (2.0 * h, 1.0), STIFF_IMPEDANCE
    mj.dof_solref[:], mj.dof_solimp[:] = (2.0 * h, 1.0), STIFF_IMPEDANCE


class MuJoCo:
    """MuJoCo with all steps between two samples in one call of mj_step."""

    name = "mujoco"
    title = "MuJoCo"

    def missing(self) -> str | None:
        """Return the reason why the tool cannot run, or None."""
        return needs("mujoco")

    def settings(self, problem: Any) -> list[Setting]:
        """Return the settings to try."""
        constrained = bool(problem.anchors) or problem.coulomb is not None
        families = [("RK4", True), ("Euler", True)]
        if constrained:
            families += [("implicitfast", True), ("RK4", False), ("Euler", False)]
        found = []
        for integrator, stiff in families:
            name = integrator + (" stiff" if stiff and constrained else "")
            for n in STEPS:
                values = {"integrator": integrator, "stiff": stiff and constrained}
                found.append(Setting(name, f"h {problem.duration / n:.1e}", n, values))
        return found

    def prepare(self, problem: Any, setting: Setting, samples: int = 1) -> Callable[[], Outcome]:
        """Return a function that runs the problem once from its start."""
        import mujoco

        mj = states(problem)
        lighten(mj)
        mj.opt.integrator = getattr(mujoco.mjtIntegrator, INTEGRATORS[setting.values["integrator"]])
        steps = setting.steps or 0
        mj.opt.timestep = problem.duration / steps
        if setting.values["stiff"]:
            stiffen(mj, mj.opt.timestep)
        data = mujoco.MjData(mj)
        coordinates = Coordinates(problem.model, mj)
        x0, u0 = coordinates.there(problem.q0, problem.v0)
        torque = None
        if problem.torque is not None:
            torque = coordinates.there(problem.q0, problem.torque)[1]

        def run() -> Outcome:
            mujoco.mj_resetData(mj, data)
            data.qpos[:], data.qvel[:] = x0, u0
            if torque is not None:
                data.qfrc_applied[:] = torque
            found = []
            for _ in range(samples):
                mujoco.mj_step(mj, data, nstep=steps // samples)
                found.append(coordinates.back(data.qpos, data.qvel))
            # MuJoCo resets a diverged state and counts a warning: data.time starts again at zero.
            made = round(data.time / mj.opt.timestep)
            bad = [w.name for w in resets(mujoco) if data.warning[w.value].number]
            if bad:
                return Outcome(None, made, steps, failure=f"diverged ({', '.join(bad)})")
            return Outcome(np.array([q for q, _ in found]), made, steps, v=found[-1][1])

        return run


def resets(mujoco: Any) -> list[Any]:
    """Return the warnings after which MuJoCo resets to its initial state."""
    kinds = mujoco.mjtWarning
    return [kinds.mjWARN_BADQPOS, kinds.mjWARN_BADQVEL, kinds.mjWARN_BADQACC]
