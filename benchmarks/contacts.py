"""Contacts that open, strike and rest, beside MuJoCo and Pinocchio's ADMM solver.

Time against error of a ball that bounces, a box that slides to rest and a box that stands on a slope, whose
ends have closed forms; the cost of a step of the standing quadruped, of an impact, and of contacts that are
declared and stay open.  Rivals are set as their documentations advise: MuJoCo with elliptic cones and
contacts as stiff as the step allows (of the bouncing ball with the damping of its restitution), Pinocchio
with the time stepping of its examples, called from Python.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

import pin_nonideal as pn

from . import timing
from .mjcf_export import mjcf, numbers

Array = NDArray[np.float64]

GRAVITY = 9.81
RESTITUTION, SLIDING, STANDING = 0.8, 0.3, 0.5  # of the ball; coefficients of friction of both boxes
SLOPE = math.atan(0.4)
EDGES, RADIUS = (0.2, 0.2, 0.1), 0.1  # of the boxes and the ball [m]
TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10)
STEPS = (1e-2, 3e-3, 1e-3, 3e-4, 1e-4)  # [s]
LEVELS = (1e-2, 1e-4, 1e-6, 1e-8)
STEP = 1e-3  # of time stepping, where one step is timed [s]
OPEN = (4, 40, 400)  # contacts that stay open
LEAST_STEPS = 1000  # of time stepping in a batch
FALLS = (1, 2, 4, 8)  # contacts that strike at once


@dataclass(frozen=True)
class Case:
    """A body whose motion on the ground has a closed form.

    Attributes:
        name: of the case.
        title: in words.
        scene: with the contacts.
        duration: of the run [s].
        end: where the middle of the body is then [m], (3,).
        geom: the body's shape and friction as attributes of an MJCF geom.
        restitution: of its contacts.
    """

    name: str
    title: str
    scene: pn.Scene
    duration: float
    end: Array
    geom: dict[str, str]
    restitution: float = 0.0


@dataclass
class Run:
    """One setting of one tool.

    Attributes:
        tool: its name.
        setting: in words.
        run: carries it out, and gives the middle of the body at the end.
    """

    tool: str
    setting: str
    run: Callable[[], Array]
    found: dict[str, Any] = field(default_factory=dict)


def free_body(inertia: Any, tilt: float = 0.0) -> Any:
    """One free body; gravity leans by `tilt` toward +x."""
    model = pin.Model()
    down = GRAVITY * np.array([math.sin(tilt), 0.0, -math.cos(tilt)])
    model.gravity = pin.Motion(down, np.zeros(3))
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "body")
    model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    model.addFrame(pin.Frame("middle", joint, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    return model


def at(height: float) -> Array:
    return np.array([0.0, 0.0, height, 0.0, 0.0, 0.0, 1.0])


def bouncing() -> Case:
    """A ball between its third and fourth impact."""
    drop, duration = 1.0, 1.9
    model = free_body(pin.Inertia.FromSphere(1.0, RADIUS))
    contact = pn.PointContact("middle", radius=RADIUS, restitution=RESTITUTION)
    begin = math.sqrt(2.0 * drop / GRAVITY)
    speed = GRAVITY * begin * RESTITUTION
    while begin + 2.0 * speed / GRAVITY < duration:
        begin, speed = begin + 2.0 * speed / GRAVITY, speed * RESTITUTION
    since = duration - begin
    end = np.array([0.0, 0.0, RADIUS + speed * since - 0.5 * GRAVITY * since**2])
    scene = pn.Scene(model, contacts=[contact], q0=at(drop + RADIUS))
    geom = {"type": "sphere", "size": numbers(RADIUS), "condim": "1"}
    return Case("bouncing", "a ball bounces", scene, duration, end, geom, RESTITUTION)


def box(mu: float, tilt: float, v0: Array) -> pn.Scene:
    model = free_body(pin.Inertia.FromBox(1.0, *EDGES), tilt)
    contacts = [c for c in pn.box_contacts("middle", EDGES, mu=mu) if c.offset[2] < 0.0]
    return pn.Scene(model, contacts=contacts, q0=at(0.5 * EDGES[2]), v0=v0)


def box_geom(mu: float) -> dict[str, str]:
    half = [0.5 * edge for edge in EDGES]
    return {"type": "box", "size": numbers(half), "condim": "3", "friction": numbers([mu, 0.0, 0.0])}


def sliding() -> Case:
    """A box that friction stops on the way."""
    speed = 2.0
    scene = box(SLIDING, 0.0, np.array([speed, 0.0, 0.0, 0.0, 0.0, 0.0]))
    end = np.array([speed**2 / (2.0 * SLIDING * GRAVITY), 0.0, 0.5 * EDGES[2]])
    return Case("sliding", "a box slides to rest", scene, 1.0, end, box_geom(SLIDING))


def standing() -> Case:
    """A box below its angle of friction: it does not move at all."""
    scene = box(STANDING, SLOPE, np.zeros(6))
    end = np.array([0.0, 0.0, 0.5 * EDGES[2]])
    return Case("standing", "a box stands on a slope for 10 s", scene, 10.0, end, box_geom(STANDING))


CASES = {make.__name__: make for make in (bouncing, sliding, standing)}


def ours(case: Case, steps: Sequence[float]) -> list[Run]:
    def run(**more: Any) -> Callable[[], Array]:
        def once() -> Array:
            q = pn.simulate(case.scene, case.duration, output_dt=case.duration, **more).q
            return np.asarray(q[-1, :3])

        return once

    found = [Run("pin_nonideal", f"dop853 rtol {rtol:.0e}", run(rtol=rtol, atol=rtol)) for rtol in TOLERANCES]
    stepped = [Run("pin_nonideal", f"moreau h {h:.0e}", run(method="moreau", dt=h)) for h in steps]
    return found + stepped


def with_ground(text: str, geoms: dict[str, list[dict[str, str]]], h: float, restitution: float) -> Any:
    """MuJoCo's model with shapes of bodies above the ground, contacts as stiff as a step h allows."""
    import mujoco

    root = ET.fromstring(text)
    option = root.find("option")
    world = root.find("worldbody")
    assert option is not None
    assert world is not None
    option.attrib |= {"timestep": numbers(h), "cone": "elliptic", "impratio": "100", "tolerance": "1e-12"}
    solref = [2.0 * h, 1.0]
    if restitution > 0.0:  # stiffness and damping themselves, as negative numbers
        log = math.log(restitution)
        damping = -log / math.hypot(math.pi, log)
        rate = 0.1 / h
        solref = [-(rate**2), -2.0 * damping * rate]
    soft = {"solref": numbers(solref), "solimp": "0.9999 0.9999 0.001 0.5 2"}
    ground = {"type": "plane", "size": "0 0 1", "friction": "0 0 0", "condim": "1"}
    ET.SubElement(world, "geom", ground | soft)
    for body in root.iter("body"):
        for geom in geoms.get(body.get("name", ""), ()):
            ET.SubElement(body, "geom", geom | soft)
    return mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"))


def mujocos(case: Case, steps: Sequence[float]) -> list[Run]:
    import mujoco

    q0, v0 = case.scene.initial_state()
    text = mjcf(case.scene.model, q0)
    found = []
    for h in steps:
        mj = with_ground(text, {"body": [case.geom]}, h, case.restitution)
        data = mujoco.MjData(mj)

        def run(mj: Any = mj, data: Any = data, count: int = round(case.duration / h)) -> Array:
            mujoco.mj_resetData(mj, data)
            data.qpos[:3], data.qvel[:] = q0[:3], v0
            mujoco.mj_step(mj, data, nstep=count)
            return np.array(data.qpos[:3])

        found.append(Run("mujoco", f"Euler h {h:.0e}", run))
    return found


class Stepping:
    """Time stepping by Pinocchio's ADMM solver, as its examples write it in Python."""

    def __init__(self, scene: pn.Scene, h: float) -> None:
        self.model, self.h = scene.model, h
        self.data = self.model.createData()
        self.models, self.datas = pin.StdVec_ConstraintModel(), pin.StdVec_ConstraintData()
        for contact in scene.contacts:
            frame = self.model.frames[self.model.getFrameId(contact.frame)]
            place = frame.placement * pin.SE3(np.eye(3), np.array(contact.offset))
            constraint = pin.PointContactConstraintModel(self.model, frame.parentJoint, place)
            constraint.set = pin.CoulombFrictionCone(contact.mu)
            self.models.append(pin.ConstraintModel(constraint))
            self.datas.append(self.models[-1].createData())
        self.solver, self.result = pin.ADMMConstraintSolver(), pin.ADMMSolverResult()
        self.settings = pin.ADMMSolverSettings()

    def step(self, q: Array, v: Array, tau: Array) -> tuple[Array, Array]:
        """One step from (q, v) with all contacts closed."""
        model, data = self.model, self.data
        free = v + self.h * pin.aba(model, data, q, v, tau)
        pin.crba(model, data, q, pin.Convention.WORLD)
        pin.computeJointJacobians(model, data, q)
        for constraint, its in zip(self.models, self.datas, strict=True):
            constraint.calc(model, data, its)
        factor = pin.ConstraintCholeskyDecomposition(model, data, self.models, self.datas)
        factor.compute(model, data, self.models, self.datas, 0.0)
        J = pin.getConstraintsJacobian(model, data, self.models, self.datas)
        delassus = factor.getDelassusOperatorCholeskyExpression()
        self.solver.solve(delassus, J @ free, self.models, self.datas, self.settings, self.result)
        impulse = self.result.retrieveConstraintImpulses()
        v = free + pin.cholesky.solve(model, data, J.T @ impulse)
        return pin.integrate(model, q, self.h * v), v


def curve(case: Case, rivals: bool, quick: bool, say: Callable[[str], None]) -> dict[str, Any]:
    """Time and error of all settings of all tools, and the fastest of each tool below each error."""
    steps = STEPS[:3] if quick else STEPS
    runs = ours(case, steps) + (mujocos(case, steps) if rivals else [])
    times = timing.paired({k: timing.per_call(r.run) for k, r in enumerate(runs)}, 2 if quick else 8)
    rows = []
    for k, r in enumerate(runs):
        error = float(np.abs(r.run() - case.end).max())
        rows.append({"tool": r.tool, "setting": r.setting, "error": error, "seconds": times[k].best})
        say(f"  {case.name}: {r.tool} {r.setting}: {error:.1e} m in {times[k].best * 1e3:.3g} ms")
    tools = list(dict.fromkeys(row["tool"] for row in rows))
    levels = []
    for level in LEVELS:
        best = {}
        for tool in tools:
            there = [row for row in rows if row["tool"] == tool and row["error"] <= level]
            if there:
                best[tool] = min(there, key=lambda row: float(str(row["seconds"])))
        levels.append({"level": level, "tools": best})
    return {"case": case.name, "title": case.title, "runs": rows, "levels": levels}


def steps_of(scene: pn.Scene, h: float, **start: Any) -> timing.Batch:
    """Steps of time stepping, so many at least that the start of a run counts little."""

    def batch(count: int) -> float:
        steps = max(count, LEAST_STEPS)
        begin = timing.clock()
        pn.simulate(scene, steps * h, method="moreau", dt=h, output_dt=steps * h, **start)
        return (timing.clock() - begin) / steps

    return batch


def quadruped(rivals: bool, quick: bool, say: Callable[[str], None]) -> list[dict[str, Any]]:
    """One step of Solo12 as it stands on its four feet, held by its motors."""
    scene = pn.load("solo12_dropped")
    rest = pn.simulate(scene, 4.0, method="moreau", dt=STEP, output_dt=4.0)
    q, v, model = rest.q[-1], np.zeros(scene.model.nv), scene.model
    known: dict[str, timing.Batch] = {"pin_nonideal": steps_of(scene, STEP, q=q, v=v)}
    stepping, motors = Stepping(scene, STEP), np.r_[np.zeros(6), np.ones(12)]

    def admm(count: int) -> float:
        x, u = q, v
        begin = timing.clock()
        for _ in range(count):
            bend = pin.difference(model, x, scene.q0)
            x, u = stepping.step(x, u, motors * (12.0 * bend - 0.4 * u))
        return (timing.clock() - begin) / count

    known["Pinocchio's ADMM, from Python"] = admm
    if rivals:
        known["mujoco"] = mujoco_steps(scene, q)
    times = timing.paired(known, 4 if quick else 30, batch_seconds=0.02)
    mine = times["pin_nonideal"]
    rows = []
    for name, its in times.items():
        ratio = timing.ratio(mine, its)
        rows.append({"tool": name, "seconds": its.best, "ratio": ratio})
        say(f"  standing Solo12: {name} {its.best * 1e6:.3g} us a step, ours over it {ratio:.2f}")
    return rows


def mujoco_steps(scene: pn.Scene, q: Array) -> timing.Batch:
    """mj_step of the same quadruped with spheres as feet."""
    import mujoco

    model = scene.model
    gains = tuple(gain * np.r_[np.zeros(6), np.ones(12)] for gain in (12.0, 0.4))
    geoms: dict[str, list[dict[str, str]]] = {}
    for contact in scene.contacts:
        foot = model.frames[model.getFrameId(contact.frame)]
        geoms.setdefault(model.names[foot.parentJoint], []).append(
            {
                "type": "sphere",
                "size": numbers(contact.radius),
                "pos": numbers(foot.placement.translation),
                "condim": "3",
                "friction": numbers([contact.mu, 0.0, 0.0]),
            }
        )
    mj = with_ground(mjcf(model, scene.q0, hold=gains), geoms, STEP, 0.0)
    mj.opt.tolerance = 1e-8  # its own default
    data = mujoco.MjData(mj)
    data.qpos[:] = q[[0, 1, 2, 6, 3, 4, 5, *range(7, model.nq)]]
    mujoco.mj_step(mj, data, nstep=2000)

    def batch(count: int) -> float:
        begin = timing.clock()
        mujoco.mj_step(mj, data, nstep=count)
        return (timing.clock() - begin) / count

    return batch


def impacts(quick: bool, say: Callable[[str], None]) -> list[dict[str, Any]]:
    """A landing by how many contacts strike at once: the cost of a run with it less one that ends before."""
    rows = []
    for count in FALLS:
        model = free_body(pin.Inertia.FromBox(1.0, *EDGES))
        corners = pn.box_contacts("middle", EDGES, mu=STANDING, restitution=0.5)
        lower = sorted(corners, key=lambda c: c.offset[2])[:4]
        contacts = [*lower, *beside(lower)][:count]
        scene = pn.Scene(model, contacts=contacts, q0=at(0.5 * EDGES[2] + 0.1), v0=[0.5, 0.1, 0, 0, 0, 0.3])
        lands = math.sqrt(2.0 * 0.1 / GRAVITY)

        def until(end: float, scene: pn.Scene = scene) -> timing.Batch:
            return timing.per_call(lambda: pn.simulate(scene, end, output_dt=end))

        times = timing.paired(
            {"without": until(0.999 * lands), "with": until(1.001 * lands)}, 4 if quick else 40
        )
        cost = times["with"].best - times["without"].best
        rows.append({"contacts": count, "seconds": cost})
        say(f"  an impact of {count} contacts: {cost * 1e6:.3g} us")
    return rows


def beside(corners: Sequence[Any]) -> list[pn.PointContact]:
    """A contact halfway between each corner and the middle, at the same height."""
    return [
        pn.PointContact(
            c.frame,
            offset=(0.5 * c.offset[0], 0.5 * c.offset[1], c.offset[2]),
            mu=c.mu,
            restitution=c.restitution,
            name=f"{c.name} inner",
        )
        for c in corners
    ]


def idle(quick: bool, say: Callable[[str], None]) -> list[dict[str, Any]]:
    """A hand in the air: run times with contacts that are declared and stay open, over those without."""
    rows = []
    arm = pn.load("panda")
    for count in OPEN:
        frames = [frame.name for frame in arm.model.frames if frame.parentJoint > 0]
        contacts = [
            pn.PointContact(frames[-1 - k % len(frames)], height=-10.0 - k, mu=0.5, name=f"floor {k}")
            for k in range(count)
        ]
        scenes = {
            "without": pn.Scene(arm.model, q0=arm.q0),
            "with": pn.Scene(arm.model, contacts=contacts, q0=arm.q0),
        }
        for name, more in (("dop853", {}), ("moreau", {"method": "moreau", "dt": STEP})):
            known = {
                which: timing.per_call(
                    lambda scene=scene, more=more: pn.simulate(scene, 0.5, output_dt=0.5, **more)
                )
                for which, scene in scenes.items()
            }
            times = timing.paired(known, 4 if quick else 40)
            ratio = timing.ratio(times["with"], times["without"])
            rows.append({"contacts": len(contacts), "method": name, "ratio": ratio})
            say(f"  {len(contacts)} open contacts, {name}: {ratio:.3f} of the time without")
    return rows


def measure(rivals: bool, quick: bool, only: str | None, say: Callable[[str], None]) -> dict[str, Any]:
    """All tables.

    Args:
        rivals: whether MuJoCo is there.
        quick: fewer settings and rounds.
        only: one case of the curves.
        say: told of progress.
    """
    cases = [make() for name, make in CASES.items() if only in (None, name)]
    return {
        "curves": [curve(case, rivals, quick, say) for case in cases],
        "steps": quadruped(rivals, quick, say),
        "impacts": impacts(quick, say),
        "open": idle(quick, say),
    }
