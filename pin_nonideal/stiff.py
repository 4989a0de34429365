"""SciPy's implicit methods on the core's right-hand side, for stiff scenes.

State y = (q, v) with q in ambient coordinates, dq/dt = T(q) v (pinocchio.tangentMap), dv/dt from Eq. (40).
One-step methods and multistep ones alike run without projection inside; every sample is projected onto the
constraints.  Modes of dry friction are chosen anew at every evaluation, without located events: prefer the
core's methods there.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from .errors import InputError, RunError, RunInterrupted, StepSizeError
from .scene import Scene
from .trajectory import Stats, Trajectory

Array = NDArray[np.float64]

# Differences of the right-hand side: the step that balances rounding against curvature.
DIFFERENCE = 6e-6


class _System:
    """y' = f(t, y) and its Jacobian."""

    def __init__(self, scene: Scene) -> None:
        self.scene, self.model = scene, scene.model
        self.nq, self.nv = self.model.nq, self.model.nv
        self.flat = all(j.nq == j.nv for j in list(self.model.joints)[1:])
        self.evaluations = 0

    def split(self, y: Array) -> tuple[Array, Array]:
        q = y[: self.nq] if self.flat else pin.normalize(self.model, y[: self.nq])
        return np.ascontiguousarray(q), np.ascontiguousarray(y[self.nq :])

    def rate(self, t: float, y: Array) -> Array:
        self.evaluations += 1
        q, v = self.split(y)
        moved = v if self.flat else pin.tangentMap(self.model, q) @ v
        return np.concatenate([moved, self.scene.acceleration(q, v, None, t)])

    def jacobian(self, t: float, y: Array) -> Array:
        """Central differences with steps that stay bounded when an angle has turned many times."""
        n = y.size
        result = np.empty((n, n))
        for k in range(n):
            h = DIFFERENCE * (1.0 if k < self.nq else max(1.0, abs(float(y[k]))))
            ahead, back = y.copy(), y.copy()
            ahead[k] += h
            back[k] -= h
            result[:, k] = (self.rate(t, ahead) - self.rate(t, back)) / (ahead[k] - back[k])
        return result


def simulate_stiff(scene: Scene, q0: Array, v0: Array, options: dict[str, Any]) -> Trajectory:
    """Runs one of SciPy's implicit methods.

    Args:
        scene: what to simulate.
        q0: initial configuration on the constraints, (nq,).
        v0: initial velocity on the constraints, (nv,).
        options: as checked by `simulate`.

    Returns:
        The Trajectory.

    Raises:
        InputError: the scene or the recording needs one of the core's methods.
        RunError: the run stopped early; its `trajectory` holds the samples up to there.
    """
    from scipy import integrate

    for key in ("energy", "power"):
        if options[key]:
            raise InputError(
                f'simulate: record "{key}" needs one of the core\'s methods; got {options["method"]}'
            )
    if scene.z0.size:
        raise InputError(
            f"simulate: laws with states need one of the core's methods; got {options['method']}"
        )
    system = _System(scene)
    samples = _Samples(scene, options)
    t0, t_end = options["t0"], options["t0"] + options["duration"]
    nv, nq = scene.model.nv, scene.model.nq
    absolute = options["atol"][: 2 * nv]
    tolerance = np.concatenate(
        [absolute[:nv] if system.flat else np.full(nq, absolute[:nv].min()), absolute[nv:]]
    )
    begin = time.perf_counter()
    steps = 0
    y0 = np.concatenate([q0, v0])
    try:
        samples.add(t0, y0, system)
        solver = getattr(integrate, options["method"])(
            system.rate, t0, y0, t_end, rtol=max(options["rtol"], 1e-13), atol=tolerance, jac=system.jacobian
        )
        grid = 1
        while solver.status == "running":
            message = solver.step()
            if solver.status == "failed":
                raise StepSizeError(
                    f"{options['method']} failed at t = {solver.t:.6g} s: {message}; loosen rtol and atol",
                    time=float(solver.t),
                )
            steps += 1
            if options["output_dt"]:
                dense = solver.dense_output()
                while t0 + grid * options["output_dt"] < min(solver.t, t_end - 1e-12):
                    at = t0 + grid * options["output_dt"]
                    samples.add(at, dense(at), system)
                    grid += 1
            if not options["output_dt"] or solver.status == "finished":
                samples.add(float(solver.t), solver.y, system)
    except KeyboardInterrupt:
        stopped: RunError = RunInterrupted(
            "the run was interrupted; the trajectory up to there is in error.trajectory"
        )
        stopped.trajectory = samples.trajectory(system, steps, time.perf_counter() - begin)
        raise stopped from None
    except RunError as error:
        error.trajectory = samples.trajectory(system, steps, time.perf_counter() - begin)
        raise
    return samples.trajectory(system, steps, time.perf_counter() - begin)


class _Samples:
    """Projected states, and what else was asked for."""

    def __init__(self, scene: Scene, options: dict[str, Any]) -> None:
        self.scene, self.options = scene, options
        self.rows: dict[str, list[Any]] = {
            k: [] for k in ("t", "q", "v", "violation", "violation_rate", "modes")
        }
        self.rows |= {k: [] for k in ("a", "F_ideal", "F_nonideal", "lam", "lam_ideal")}

    def add(self, t: float, y: Array, system: _System) -> None:
        q, v = self.scene.project(*system.split(y), t)
        runner = self.scene.new_runner()
        _, _, residual, rate = runner.rows(q, v, t)
        rows = self.rows
        rows["t"].append(t)
        rows["q"].append(q)
        rows["v"].append(v)
        rows["violation"].append(float(np.abs(residual).max(initial=0.0)))
        rows["violation_rate"].append(float(np.abs(rate).max(initial=0.0)))
        if not (self.options["a"] or self.options["forces"] or self.scene.element_names):
            return
        out = runner.solve(q, v, t, None, None)
        rows["modes"].append(out["modes"])
        for key in ("a", "F_ideal", "F_nonideal", "lam", "lam_ideal"):
            rows[key].append(out[key])

    def trajectory(self, system: _System, steps: int, wall: float) -> Trajectory:
        model, nt = self.scene.model, len(self.rows["t"])
        shape = {
            "t": (nt,),
            "q": (nt, model.nq),
            "v": (nt, model.nv),
            "violation": (nt,),
            "violation_rate": (nt,),
        }
        fields: dict[str, Any] = {k: np.array(self.rows[k], dtype=float).reshape(s) for k, s in shape.items()}
        wanted = [*(["a"] if self.options["a"] else [])]
        wanted += ["F_ideal", "F_nonideal", "lam", "lam_ideal"] if self.options["forces"] else []
        for key in wanted:
            fields[key] = np.array(self.rows[key]).reshape(nt, -1)
        if self.scene.element_names:
            fields["modes"] = np.array(self.rows["modes"], dtype=np.int8).reshape(nt, -1)
        return Trajectory(
            **fields,
            stats=Stats(steps=steps, evaluations=system.evaluations, wall_s=wall),
            scene=self.scene,
            element_names=list(self.scene.element_names),
            name=self.scene.name,
        )
