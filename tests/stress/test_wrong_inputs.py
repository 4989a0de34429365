"""Invalid inputs: each raises a short error with its name, before any work and without a file."""

from __future__ import annotations

import os
import pickle
import re
import zipfile
from dataclasses import replace
from types import SimpleNamespace

import coal
import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.cli.main import main
from pin_nonideal.errors import MESSAGE_MAX, PinNonidealError, nearest, short_repr
from pin_nonideal.simulation import scipy_solvers
from pin_nonideal.simulation import simulate as simulate_module
from pin_nonideal.visualization import plotting, rendering, replay

NAN, INF = float("nan"), float("inf")
LONG = "x" * 100_000
# Words of Python, NumPy and zip archives.
FOREIGN = re.compile(r"NoneType' object|pickle|BadZip|\[Errno|not subscriptable|unhashable")
MANY = [{"crank_joint": float(k)} for k in range(4000)]


def never_made(**parameters):
    raise AssertionError("a scene was made")


def terminal_by_word(t, q, v):
    return 1.0


terminal_by_word.terminal = "yes"


# Each case: the argument that the message names, and a call with the scene, its state and a run in `g`.
SCENES = {
    "name of a robot": ("name", lambda g: pn.load(3)),
    "long name of a robot": ("name", lambda g: pn.load(LONG)),
    "home of nobody": ("name", lambda g: pn.load("~nobody-of-this-name/arm.urdf")),
    "unknown robot": ("nothing", lambda g: pn.load("nothing")),
    "missing file": ("none.urdf", lambda g: pn.load("none.urdf")),
    "folder without a robot": ("folder", lambda g: pn.load("./folder")),
    "text for a URDF": ("text.urdf", lambda g: pn.load("text.urdf")),
    "parameter of another robot": ("Q", lambda g: pn.load("n_four_bar", Q=3)),
    "parameter as text": ("N", lambda g: pn.load("n_four_bar", N="many")),
    "parameter below its bound": ("N", lambda g: pn.load("n_four_bar", N=-1)),
    "start of an unknown joint": ("q0", lambda g: pn.load("four_bar", q0={"arm": 1.0})),
    "start that is not finite": ("v0", lambda g: pn.load("four_bar", v0={"crank_joint": NAN})),
    "limits as text": ("limits", lambda g: pn.load("four_bar", limits="yes")),
    "terms": ("terms", lambda g: pn.load("four_bar", terms="cor")),
    "model": ("model", lambda g: pn.Scene("four_bar")),
    "one constraint": ("constraints", lambda g: pn.Scene(g.model, constraints=g.scene.constraints[0])),
    "constraint of another kind": ("constraint", lambda g: pn.Scene(g.model, constraints=[3])),
    "law of another kind": ("law", lambda g: pn.Scene(g.model, laws=[LONG])),
    "force of another kind": ("force", lambda g: pn.Scene(g.model, forces=[MANY])),
    "contact of another kind": ("contact", lambda g: pn.Scene(g.model, contacts=[{}])),
    "short q0": ("q0", lambda g: pn.Scene(g.model, q0=[1.0])),
    "v0 of objects": ("v0", lambda g: pn.Scene(g.model, v0=[None, {}, "a"])),
    "impact": ("impact", lambda g: pn.Scene(g.model, impact="newtonian")),
    "assembly tolerance": ("assembly_tolerance", lambda g: pn.Scene(g.model, assembly_tolerance=-1.0)),
    "actuation of another length": ("actuation", lambda g: pn.Scene(g.model, actuation=[1.0])),
    "description to remove": ("remove", lambda g: g.scene.replace(remove="loop")),
    "unknown description to remove": ("nope", lambda g: g.scene.replace(remove=["nope"])),
    "model without data": ("model", lambda g: pn.Scene(pin.Data())),
    "table of constraints": ("constraints", lambda g: pn.Scene(g.model, constraints={"loop": None})),
    "law among contacts": ("contact", lambda g: pn.Scene(g.model, contacts=[g.scene.laws[0]])),
    "notes": ("notes", lambda g: pn.Scene(g.model, notes="hello")),
    "ground below no base": ("put_on_ground", lambda g: g.scene.put_on_ground()),
    "rows of nothing": ("nope", lambda g: g.scene.jacobian("nope")),
    "rows of a state": ("name", lambda g: g.scene.jacobian({"crank_joint": 0.1})),
    "masked angle": ("q", lambda g: g.scene.mass_matrix(np.ma.masked_array([1.0, 2.0, 3.0], [0, 1, 0]))),
    "tolerance of a stepper": ("rtol", lambda g: g.scene.stepper(0.1, method="dop853", rtol=5.0)),
    "steps beyond the period": ("period", lambda g: g.scene.stepper(0.01, dt=1.0)),
    "directories of packages": ("package_dirs", lambda g: pn.load("four_bar", package_dirs=3)),
    "bytes for a name": ("name", lambda g: pn.load(b"four_bar")),
}  # fmt: skip
LAWS = {
    "joint of a law": ("joint", lambda g: pn.JointFriction(3, coulomb=0.1)),
    "negative friction": ("coulomb", lambda g: pn.JointFriction("crank_joint", coulomb=-0.1)),
    "reaction": ("reaction", lambda g: pn.JointFriction("crank_joint", coulomb=0.1, reaction="totl")),
    "joint that does not exist": (
        "elbow",
        lambda g: pn.Scene(g.model, laws=[pn.JointFriction("elbow", coulomb=1.0)]),
    ),
    "law without a function": ("function", lambda g: pn.UserLaw(3)),
    "limit that is no function": ("limit", lambda g: pn.UserFriction(never_made, limit=0.1)),
    "drag": ("coefficient", lambda g: pn.Drag("coupler_tip", coefficient=NAN, exponent=1.0)),
    "stiffness as text": ("stiffness", lambda g: pn.JointSpring("crank_joint", stiffness="soft")),
    "axes of an anchor": ("axes", lambda g: pn.PointAnchor("coupler_tip", "universe", axes="xx")),
    "length of a rod": ("length", lambda g: pn.Distance("coupler_tip", "universe", length=-1.0)),
    "function of a motion": ("function", lambda g: pn.PrescribedMotion("crank_joint", function=3)),
    "name of a description": ("name", lambda g: pn.PointAnchor("coupler_tip", "universe", name=3)),
    "empty polynomial": ("coefficients", lambda g: pn.polynomial([])),
    "spline with NaN": ("values", lambda g: pn.spline([0.0, 1.0], [NAN, 1.0])),
    "times of a spline": ("times", lambda g: pn.spline([1.0, 0.0], [0.0, 1.0])),
    "constant": ("value", lambda g: pn.constant(INF)),
    "mass matrix": ("F", lambda g: pn.solve(np.eye(2), np.ones(3))),
    "friction of nothing": ("scene", lambda g: pn.JointFriction.for_joints("four_bar", coulomb=1.0)),
    "number of joints": ("joints", lambda g: pn.JointFriction.for_joints(g.scene, 3, coulomb=1.0)),
    "misspelt coefficient": ("coulmb", lambda g: pn.JointFriction.for_joints(g.scene, coulmb=1.0)),
    "misspelt coefficient of a joint": (
        "viscos",
        lambda g: pn.JointFriction.for_joints(g.scene, {"crank_joint": {"viscos": 1.0}}),
    ),
    "angle in degrees": ("lead_angle", lambda g: pn.JointFriction("a", mu=0.1, lead_angle=90.0)),
    "efficiency above one": ("efficiency", lambda g: pn.JointFriction("a", efficiency=1.5)),
    "stiction below kinetic friction": ("stiction", lambda g: pn.LuGre("a", 1e4, 1.0, 1.0, stiction=0.5)),
    "three numbers of a wrench": ("value", lambda g: pn.Wrench("coupler_tip", [1.0, 2.0, 3.0])),
    "couple of a joint with itself": (
        "joint1",
        lambda g: pn.Scene(g.model, constraints=[pn.JointCoupling("crank_joint", "crank_joint", 2.0)]),
    ),
    "axis of no length": ("axis", lambda g: pn.HingeAnchor("a", "b", axis=[0.0, 0.0, 0.0])),
    "rate that is no derivative": (
        "rate",
        lambda g: pn.Scene(
            g.model, constraints=[pn.PrescribedMotion("crank_joint", lambda t: (3 * t, 0.0, 0.0))]
        ),
    ),
    "ends of a spline": ("ends", lambda g: pn.spline([0, 1, 2], [0, 1, 0], ends="open")),
    "cones": ("W", lambda g: pn.cone_complementarity(np.eye(3), np.ones(2), 0.5)),
}  # fmt: skip
CONTACTS = {
    "coefficient": ("mu", lambda g: pn.PointContact("coupler_tip", mu=-0.3)),
    "restitution": ("restitution", lambda g: pn.PointContact("coupler_tip", 0.3, restitution=1.5)),
    "frame": ("frame", lambda g: pn.PointContact(3, 0.3)),
    "unknown frame": ("foot", lambda g: pn.Scene(g.model, contacts=[pn.PointContact("foot", 0.3)])),
    "radius": ("radius1", lambda g: pn.SphereContact("coupler_tip", "universe", -0.1, mu=0.3)),
    "size of a box": ("size", lambda g: pn.BoxContact("coupler_tip", "universe", [1.0, 2.0], 0.1)),
    "points of a hull": ("points", lambda g: pn.HullContact("coupler_tip", "universe", [[NAN] * 3], 0.1)),
    "bounds of a joint": ("lower", lambda g: pn.JointLimit("crank_joint", lower=NAN)),
    "collision model": ("collision_model", lambda g: pn.geometry_contacts(g.model, "shapes")),
    "scene for a model": ("scene.model", lambda g: pn.ground_contacts(g.scene, g.scene)),
    "missing srdf": ("none.srdf", lambda g: pn.geometry_contacts(g.model, pin.GeometryModel(), "none.srdf")),
    "stops that cross": ("lower", lambda g: pn.JointLimit("crank_joint", lower=1.0, upper=0.0)),
    "semiaxes": ("semiaxes", lambda g: pn.EllipsoidContact("coupler_tip", (1.0, 1.0))),
    "points of no rim": ("points", lambda g: pn.RimContact("coupler_tip", "universe", (), 0.1, 0.1)),
    "normal": ("normal", lambda g: pn.PointContact("coupler_tip", normal="up")),
    "negative edge": ("size", lambda g: pn.box_contacts("coupler_tip", [1.0, -2.0, 1.0])),
    "shapes without a model": (
        "collision_model",
        lambda g: pn.Scene(g.model, contacts=[pn.GeometryContact("a", "b")]),
    ),
    "height of the ground": ("height", lambda g: pn.ground(height="sea level")),
    "mass and density": (
        "density",
        lambda g: pn.free_body(pin.Model(), "a", coal.Box(1, 1, 1), 1.0, mass=1.0),
    ),
}  # fmt: skip
RUNS = {
    "scene": ("scene", lambda g: pn.simulate("four_bar", 1.0)),
    "duration as text": ("duration", lambda g: pn.simulate(g.scene, "1")),
    "no duration": ("duration", lambda g: pn.simulate(g.scene, 0.0)),
    "q of another length": ("q", lambda g: pn.simulate(g.scene, 1.0, [1.0])),
    "q of an unknown joint": ("elbow", lambda g: pn.simulate(g.scene, 1.0, {"elbow": 1.0})),
    "q with NaN": ("q", lambda g: pn.simulate(g.scene, 1.0, {"crank_joint": NAN})),
    "v as text": ("v", lambda g: pn.simulate(g.scene, 1.0, v="fast")),
    "time": ("t0", lambda g: pn.simulate(g.scene, 1.0, t0=NAN)),
    "method": ("method", lambda g: pn.simulate(g.scene, 1.0, method="ode45")),
    "long method": ("method", lambda g: pn.simulate(g.scene, 1.0, method=LONG)),
    "list of methods": ("method", lambda g: pn.simulate(g.scene, 1.0, method=["rk4"])),
    "rtol above its bound": ("rtol", lambda g: pn.simulate(g.scene, 1.0, rtol=0.5)),
    "rtol below rounding": ("rtol", lambda g: pn.simulate(g.scene, 1.0, rtol=1e-17)),
    "rtol as text": ("rtol", lambda g: pn.simulate(g.scene, 1.0, rtol="1e-8")),
    "atol of another length": ("atol", lambda g: pn.simulate(g.scene, 1.0, atol=[1.0])),
    "no tolerance": ("atol", lambda g: pn.simulate(g.scene, 1.0, rtol=0.0, atol=0.0)),
    "dt of an adaptive method": ("dt", lambda g: pn.simulate(g.scene, 1.0, dt=0.1)),
    "fixed steps without dt": ("dt", lambda g: pn.simulate(g.scene, 1.0, method="rk4")),
    "too many samples": ("output_dt", lambda g: pn.simulate(g.scene, 1e3, output_dt=1e-9)),
    "part of a step": ("max_steps", lambda g: pn.simulate(g.scene, 1.0, max_steps=0.5)),
    "wall time": ("max_wall", lambda g: pn.simulate(g.scene, 1.0, max_wall=-1.0)),
    "record": ("record", lambda g: pn.simulate(g.scene, 1.0, record=["enrgy"])),
    "record in a list of a list": ("record", lambda g: pn.simulate(g.scene, 1.0, record=[["energy"]])),
    "record as a table": ("record", lambda g: pn.simulate(g.scene, 1.0, record={"energy": True})),
    "event": ("events", lambda g: pn.simulate(g.scene, 1.0, events=3)),
    "separate without a grid": ("output_dt", lambda g: pn.simulate(g.scene, 1.0, events="separate")),
    "callback": ("callback", lambda g: pn.simulate(g.scene, 1.0, callback=3)),
    "several": ("several", lambda g: pn.simulate(g.scene, 1.0, several="go on")),
    "strict": ("strict", lambda g: pn.simulate(g.scene, 1.0, strict="yes")),
    "progress": ("progress", lambda g: pn.simulate(g.scene, 1.0, progress="bar")),
    "checkpoint in no folder": ("none/run", lambda g: pn.simulate(g.scene, 1.0, checkpoint="none/run")),
    "checkpoint that is a folder": ("folder", lambda g: pn.simulate(g.scene, 1.0, checkpoint="folder")),
    "checkpoint with a long name": ("checkpoint", lambda g: pn.simulate(g.scene, 1.0, checkpoint=LONG)),
    "checkpoint of SciPy": ("checkpoint", lambda g: pn.simulate(g.scene, 1.0, method="BDF", checkpoint="a")),
    "interval": ("checkpoint_interval", lambda g: pn.simulate(g.scene, 1.0, checkpoint_interval=NAN)),
    "rows of states": ("q", lambda g: pn.rollout(g.scene, g.q, g.v, 1.0)),
    "unequal numbers of states": ("q", lambda g: pn.rollout(g.scene, [g.q], [g.v, g.v], 1.0)),
    "jobs": ("jobs", lambda g: pn.rollout(g.scene, [g.q], [g.v], 1.0, jobs=0)),
    "failures": ("failures", lambda g: pn.rollout(g.scene, [g.q], [g.v], 1.0, failures="skip")),
    "parameters": ("parameters", lambda g: pn.rollout(g.scene, [g.q], [g.v], 1.0, parameters=[1.0])),
    "method of SciPy": ("method", lambda g: pn.rollout(g.scene, [g.q], [g.v], 1.0, method="Radau")),
    "period": ("period", lambda g: g.scene.stepper(0.0)),
    "step": ("dt", lambda g: g.scene.step(g.q, g.v, None, -1.0)),
    "torques": ("tau", lambda g: g.scene.solve(g.q, g.v, tau=[1.0])),
    "modes": ("modes", lambda g: g.scene.solve(g.q, g.v, modes=[7])),
    "name of a robot for a scene": ("pn.load('four_bar')", lambda g: pn.simulate("four_bar", 1.0)),
    "model for a scene": ("pn.Scene(model)", lambda g: pn.simulate(g.model, 1.0)),
    "complex duration": ("duration", lambda g: pn.simulate(g.scene, 1.0 + 0.0j)),
    "flag for a number": ("rtol", lambda g: pn.simulate(g.scene, 1.0, rtol=True)),
    "generator of angles": ("q", lambda g: pn.simulate(g.scene, 1.0, q=(x for x in [1.0, 2.0, 3.0]))),
    "angles that open the loop": ("rocker_joint", lambda g: pn.simulate(g.scene, 1.0, {"rocker_joint": 0.0})),
    "coarse clock": ("duration", lambda g: pn.simulate(g.scene, 1e-12, t0=1e6)),
    "terminal": ("terminal", lambda g: pn.simulate(g.scene, 1.0, events=terminal_by_word)),
    "numbers of each run": (
        "main bearing",
        lambda g: pn.rollout(g.scene, [g.q] * 2, [g.v] * 2, 1.0, parameters={"main bearing": {"mu": [0.1]}}),
    ),
    "field of a law": (
        "mue",
        lambda g: pn.rollout(g.scene, [g.q], [g.v], 1.0, parameters={"main bearing": {"mue": [0.1]}}),
    ),
    "state to project": ("v", lambda g: g.scene.project(g.q, "fast")),
}  # fmt: skip
ACTUATION = {
    "values as a list of tables": ("values", lambda g: pn.Table(range(4000), MANY)),
    "values with NaN": ("values", lambda g: pn.Table([0.0, 1.0], [[1.0], [NAN]])),
    "column with NaN": ("values", lambda g: pn.Table([0.0, 1.0], {"crank_joint": [0.0, NAN]})),
    "column of another length": ("values", lambda g: pn.Table([0.0, 1.0], {"crank_joint": [0.0]})),
    "times that stand": ("times", lambda g: pn.Table([0.0, 0.0], [[1.0], [2.0]])),
    "times as text": ("times", lambda g: pn.Table("ab", [[1.0], [2.0]])),
    "unknown column": (
        "crank",
        lambda g: g.scene.replace(actuation=pn.Table([0.0, 1.0], {"crank": [0.0, 1.0]})),
    ),
    "gain": ("kp", lambda g: pn.HoldPosition(-1.0, 0.1)),
    "gain of a table with NaN": ("kd", lambda g: pn.HoldPosition(1.0, {"crank_joint": NAN})),
    "period of a controller": ("period", lambda g: pn.SampledControl(lambda t, q, v: 0.0, 0.0)),
    "controller": ("function", lambda g: pn.SampledControl(3, 0.1)),
    "joints of a controller": ("joints", lambda g: pn.SampledControl(never_made, 0.1, joints="crank")),
    "unknown joint of a controller": (
        "crank",
        lambda g: g.scene.replace(actuation=pn.SampledControl(lambda t, q, v: {}, 0.1, joints=["crank"])),
    ),
    "table between samples of a controller": (
        "times",
        lambda g: pn.simulate(
            g.scene.replace(
                actuation=[
                    pn.SampledControl(lambda t, q, v: {}, 0.1, joints=["crank_joint"]),
                    pn.Table([0.0, 0.25], {"rocker_joint": [0.0, 1.0]}, interpolation="hold"),
                ]
            ),
            1.0,
        ),
    ),
    "limits without torques": ("actuation", lambda g: pn.EffortLimits(None, 1.0)),
    "effort": ("effort", lambda g: pn.EffortLimits([1.0, 1.0, 1.0], -1.0)),
    "gain as text": ("kp", lambda g: pn.HoldPosition("stiff", 1.0)),
    "torque as text": ("crank_joint", lambda g: pn.Scene(g.model, actuation={"crank_joint": "strong"})),
    "masked log": ("values", lambda g: pn.Table([0.0, 1.0], np.ma.masked_equal([[1.0], [-9.0]], -9.0))),
    "two delays": ("delay", lambda g: pn.SampledControl(never_made, 0.01, delay=0.01, delay_samples=2)),
    "interpolation": ("interpolation", lambda g: pn.Table([0.0], [[1.0]], interpolation="cubic")),
    "reference that opens the loop": (
        "loop",
        lambda g: pn.simulate(
            g.scene.replace(
                actuation=pn.TrackTrajectory(
                    [0.0, 0.1], [g.q, g.q + 0.1], kp=1.0, kd=1.0, feedforward="constrained"
                )
            ),
            0.1,
        ),
    ),
}  # fmt: skip
SWEEPS = {
    "make": ("make", lambda g: pn.sweep("four_bar", [{}], 1.0)),
    "one mapping": ("parameters", lambda g: pn.sweep(never_made, {"mu": 1.0}, 1.0)),
    "no mappings": ("parameters", lambda g: pn.sweep(never_made, [3], 1.0)),
    "duration": ("duration", lambda g: pn.sweep(never_made, [{}], NAN)),
    "no jobs": ("jobs", lambda g: pn.sweep(never_made, [{}], 1.0, jobs=0)),
    "unknown option": ("rtoll", lambda g: pn.sweep(never_made, [{}], 1.0, jobs=1, rtoll=1e-6, store="new")),
    "option out of its bounds": ("rtol", lambda g: pn.sweep(never_made, [{}], 1.0, rtol=3.0, store="new")),
    "record": ("record", lambda g: pn.sweep(never_made, [{}], 1.0, record="enrgy", store="new")),
    "progress": ("progress", lambda g: pn.sweep(never_made, [{}], 1.0, progress="bar", store="new")),
    "measure": ("measure", lambda g: pn.sweep(never_made, [{}], 1.0, measure=3, store="new")),
    "store that is a file": ("text.npz", lambda g: pn.sweep(never_made, [{}], 1.0, store="text.npz")),
    "store of other files": ("store", lambda g: pn.sweep(never_made, [{}], 1.0, store="full")),
    "checkpoint of all runs": ("checkpoint", lambda g: pn.sweep(never_made, [{}], 1.0, checkpoint="a")),
    "folder without a sweep": ("folder", lambda g: pn.Sweep("folder")),
    "folder of a sweep": ("folder", lambda g: pn.Sweep(3)),
    "grid": ("mu", lambda g: pn.sweep_grid(mu=0.3)),
    "kind of samples": ("kind", lambda g: pn.sweep_samples(4, kind="sobel", mu=(0.1, 0.5))),
    "reversed range": ("mu", lambda g: pn.sweep_samples(4, mu=(1.0, 0.0))),
    "range of samples": ("mu", lambda g: pn.sweep_samples(4, mu=0.3)),
}  # fmt: skip
STATICS = {
    "scene": ("scene", lambda g: pn.equilibrium("four_bar")),
    "start of another length": ("q", lambda g: pn.equilibrium(g.scene, [1.0])),
    "torques of an unknown joint": ("elbow", lambda g: pn.equilibrium(g.scene, tau={"elbow": 1.0})),
    "starts": ("starts", lambda g: pn.equilibrium(g.scene, starts=0)),
    "stable": ("stable", lambda g: pn.equilibrium(g.scene, stable="yes")),
    "rest with NaN": ("q", lambda g: pn.rest(g.scene, [NAN, 0.0, 0.0])),
    "torques at rest": ("tau", lambda g: pn.rest(g.scene, g.q, [1.0])),
    "accelerations": ("a", lambda g: pn.inverse_dynamics(g.scene, g.q, g.v, [1.0])),
    "actuated": ("actuated", lambda g: pn.inverse_dynamics(g.scene, g.q, g.v, g.v, "crank_joint")),
    "bounds": ("bounds", lambda g: pn.inverse_dynamics(g.scene, g.q, g.v, g.v, bounds=3)),
    "bounds that cross": ("bounds", lambda g: pn.inverse_dynamics(g.scene, g.q, g.v, g.v, bounds=(1, -1))),
}  # fmt: skip
FILES = {
    "text": ("text.npz", lambda g: pn.Trajectory.load("text.npz")),
    "archive of something else": ("other.npz", lambda g: pn.Trajectory.load("other.npz")),
    "zip of something else": ("zip.npz", lambda g: pn.Trajectory.load("zip.npz")),
    "truncated": ("cut.npz", lambda g: pn.Trajectory.load("cut.npz")),
    "empty": ("empty.npz", lambda g: pn.Trajectory.load("empty.npz")),
    "one array": ("array.npy", lambda g: pn.Trajectory.load("array.npy")),
    "pickle": ("object.npz", lambda g: pn.Trajectory.load("object.npz")),
    "folder": ("folder", lambda g: pn.Trajectory.load("folder")),
    "missing": ("none.npz", lambda g: pn.Trajectory.load("none.npz")),
    "path": ("path", lambda g: pn.Trajectory.load(3)),
    "scene of another run": ("scene", lambda g: pn.Trajectory.load("run.npz", scene=g.other)),
    "name of a scene": ("scene", lambda g: pn.Trajectory.load("run.npz", scene="four_bar")),
    "checkpoint that is text": ("text.npz", lambda g: pn.resume("text.npz")),
    "checkpoint that is a run": ("run.npz", lambda g: pn.resume("run.npz")),
    "scene to resume": ("scene", lambda g: pn.resume("run.npz", "four_bar")),
    "run without a path": ("path", lambda g: g.run.save(None)),
    "run in no folder": ("none/run.npz", lambda g: g.run.save("none/run.npz")),
    "run with a long name": ("path", lambda g: g.run.save(LONG)),
}  # fmt: skip
TRAJECTORIES = {
    "energy that was not recorded": ("energy", lambda g: g.run.energy["total"]),
    "power that was not recorded": ("power", lambda g: g.run.power["actuation"]),
    "reactions that were not recorded": ("reactions", lambda g: g.run.reactions["crank_joint"]),
    "column of the energy": ("energy", lambda g: g.full.energy["totl"]),
    "joint": ("elbow", lambda g: g.run.joint("elbow")),
    "number of a joint": ("name", lambda g: g.run.joint(0)),
    "list of joints": ("name", lambda g: g.run.joint(["crank_joint"])),
    "long name": ("xxx", lambda g: g.run.joint("xxx " * 1000)),
    "force": ("name", lambda g: g.run.force([])),
    "law": ("name", lambda g: g.run.law({})),
    "frame": ("name", lambda g: g.run.frame(3)),
    "axes": ("axes", lambda g: g.full.reaction("crank_joint", axes="body")),
    "time without interpolants": ("dense", lambda g: g.run.at(0.01)),
    "more samples than there are": ("count", lambda g: g.run.first(1000)),
    "samples": ("chosen", lambda g: g.run.samples([1000])),
}  # fmt: skip
PICTURES = {
    "replay of nothing": ("Trajectory", lambda g: pn.replay(None, "a.html")),
    "replay in no folder": ("none/a.html", lambda g: pn.replay(g.run, "none/a.html")),
    "replay into a folder": ("folder", lambda g: pn.replay(g.run, "folder")),
    "plots": ("nope", lambda g: pn.replay(g.run, "a.html", plots=["nope"])),
    "number of plots": ("plots", lambda g: pn.replay(g.run, "a.html", plots=3)),
    "plot that was not recorded": ("energy", lambda g: pn.replay(g.run, "a.html", plots=["energy"])),
    "names": ("names", lambda g: pn.replay([g.run, g.run], "a.html", names=["first"])),
    "frames": ("fps", lambda g: pn.replay(g.run, "a.html", fps=NAN)),
    "title": ("title", lambda g: pn.replay(g.run, "a.html", title=3)),
    "viewer": ("viewer", lambda g: pn.replay(g.run, viewer=3)),
    "format": ("a.xyz", lambda g: pn.plot(g.run, "a.xyz")),
    "figure in no folder": ("none/a.png", lambda g: pn.plot(g.run, "none/a.png")),
    "figure": ("nothing", lambda g: pn.plot(g.run, "a.png", what=["nothing"])),
    "no figure": ("what", lambda g: pn.plot(g.run, "a.png", what=[])),
    "axes": ("ax", lambda g: pn.plot(g.run, what="q", ax=3)),
    "columns": ("columns", lambda g: pn.plot(g.run, columns=3)),
    "style": ("style", lambda g: pn.plot(g.run, style={"lines.widht": 1.0})),
    "value of a style": ("style", lambda g: pn.plot(g.run, style={"lines.linewidth": "thick"})),
    "run to render": ("run", lambda g: pn.render(None, "a.png")),
    "picture in no folder": ("none/a.png", lambda g: pn.render(g.run, "none/a.png")),
    "ending": ("a.bmp", lambda g: pn.render(g.run, "a.bmp")),
    "width": ("width", lambda g: pn.render(g.run, "a.png", width=0)),
    "time outside": ("time", lambda g: pn.render(g.run, "a.png", time=9.0)),
    "rate": ("fps", lambda g: pn.render(g.run, "a.gif", fps=INF)),
    "forces as text": ("render: forces", lambda g: pn.render(g.run, "a.png", forces="no")),
    "run without its scene": ("scene", lambda g: pn.plot(replace(g.run, scene=None), "a.png")),
    "curve of another length": ("Own [m]", lambda g: pn.plot(g.run, "a.png", [("Own [m]", {"a": [1.0]})])),
}  # fmt: skip
CASES = {
    f"{group}: {name}": case
    for group, cases in {
        "scenes": SCENES, "laws": LAWS, "contacts": CONTACTS, "runs": RUNS, "actuation": ACTUATION,
        "sweeps": SWEEPS, "statics": STATICS, "files": FILES, "trajectories": TRAJECTORIES,
        "pictures": PICTURES,
    }.items()
    for name, case in cases.items()
}  # fmt: skip
COMMANDS = {
    "run nothing": ("nothing", ["run", "nothing"]),
    "run --duration": ("duration", ["run", "four_bar", "--duration", "nan"]),
    "run --method": ("method", ["run", "four_bar", "--method", "ode45"]),
    "run --rtol": ("rtol", ["run", "four_bar", "--rtol", "7"]),
    "run --record": ("record", ["run", "four_bar", "--record", "enrgy"]),
    "run --set": ("--set", ["run", "four_bar", "--set", "N"]),
    "run --q": ("--q", ["run", "four_bar", "--q", "elbow"]),
    "run --save": ("none/a.npz", ["run", "four_bar", "--save", "none/a.npz"]),
    "run --html": ("folder", ["run", "four_bar", "--html", "folder"]),
    "run --plot": ("a.xyz", ["run", "four_bar", "--plot", "a.xyz"]),
    "run --checkpoint": ("none/a", ["run", "four_bar", "--checkpoint", "none/a"]),
    "resume": ("text.npz", ["resume", "text.npz"]),
    "resume --save": ("none/a.npz", ["resume", "text.npz", "--save", "none/a.npz"]),
    "replay text": ("text.npz", ["replay", "text.npz"]),
    "replay into no folder": ("none/a.html", ["replay", "run.npz", "none/a.html"]),
    "replay --run": ("--run", ["replay", "run.npz", "--run", "3"]),
    "render --width": ("width", ["render", "run.npz", "a.png", "--width", "0"]),
    "render into no folder": ("none/a.png", ["render", "run.npz", "none/a.png"]),
    "render --time": ("time", ["render", "run.npz", "a.png", "--time", "99"]),
    "sweep text": ("text.npz", ["sweep", "text.npz"]),
    "sweep option": ("rtoll", ["sweep", "sweep.yaml"]),
    "equilibrium --q": ("elbow", ["equilibrium", "four_bar", "--q", "elbow=1"]),
}  # fmt: skip


@pytest.fixture(scope="module")
def known():
    scene = pn.load("four_bar")
    q, v = scene.initial_state()
    run, full = pn.simulate(scene, 0.05), pn.simulate(scene, 0.05, record=("energy", "reactions"))
    other = pn.load("n_four_bar", N=2)
    return SimpleNamespace(scene=scene, model=scene.model, q=q, v=v, run=run, full=full, other=other)


@pytest.fixture
def files(known, tmp_path, monkeypatch):
    """Files that are something else, in the working directory; nothing may work, and no file may be added."""
    monkeypatch.chdir(tmp_path)
    whole = known.run.save("run.npz").read_bytes()
    (tmp_path / "cut.npz").write_bytes(whole[: len(whole) // 3])
    (tmp_path / "text.npz").write_text("hello")
    (tmp_path / "text.urdf").write_text("hello")
    (tmp_path / "empty.npz").write_text("")
    (tmp_path / "object.npz").write_bytes(pickle.dumps({"t": 1.0}))
    (tmp_path / "sweep.yaml").write_text(
        "robot: four_bar\nduration: 1.0\ngrid: {limits: [true]}\noptions: {rtoll: 1.0e-6}\n"
    )
    np.savez("other.npz", a=np.ones(3))
    np.save("array.npy", np.ones(3))
    with zipfile.ZipFile("zip.npz", "w") as archive:
        archive.writestr("readme.txt", "hello")
    (tmp_path / "folder").mkdir()
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.tex").write_text("")

    def work(*arguments, **options):
        raise AssertionError("work began")

    for module, name in (
        (simulate_module, "run_together"),
        (simulate_module, "run_decoupled"),
        (scipy_solvers, "simulate_stiff"),
        (rendering, "_pictures"),
        (plotting, "_figure"),
        (replay, "packed_runs"),
    ):
        monkeypatch.setattr(module, name, work)
    before = listed(tmp_path)
    yield tmp_path
    assert listed(tmp_path) == before


def listed(folder):
    return sorted(os.path.join(where, name) for where, _, names in os.walk(folder) for name in names)


def test_there_are_enough_cases():
    assert len(CASES) + len(COMMANDS) >= 250


@pytest.mark.parametrize("case", CASES)
def test_a_wrong_input_is_refused(case, known, files):
    argument, call = CASES[case]
    with pytest.raises(PinNonidealError) as caught:
        call(known)
    message = str(caught.value)
    assert re.search(rf"(?<!\w){re.escape(argument)}", message), message
    assert len(message) <= MESSAGE_MAX
    assert not FOREIGN.search(message), message


@pytest.mark.parametrize("case", COMMANDS)
def test_a_wrong_command_is_refused(case, files, capsys):
    argument, words = COMMANDS[case]
    assert main(words) == 2
    message = capsys.readouterr().err
    assert argument in message, message
    assert len(message) <= MESSAGE_MAX + len("pin-nonideal: error: \n")


def test_values_in_messages_are_short():
    class Odd:
        def __repr__(self):
            raise RuntimeError("no repr")

    assert short_repr(Odd()) == "<Odd>"
    assert short_repr([1, "a", None]) == "[1, 'a', None]"
    for value in (LONG, MANY, np.ones((300, 300)), {str(k): LONG for k in range(9)}, [[LONG]] * 99):
        assert len(short_repr(value)) <= 160
    assert len(str(pn.InputError(LONG + "; remedy"))) == MESSAGE_MAX
    assert str(pn.InputError(LONG + "; remedy")).endswith("x; remedy")


@pytest.mark.parametrize(
    ("name", "known", "hint"),
    [
        ("nothing", ["tiago", "panda"], '; known: "tiago", "panda"'),
        ("crank", ["coupler_joint", "crank_joint"], '; nearest: "crank_joint"'),
        ("four_baar", ["panda", "four_bar"], '; nearest: "four_bar"'),
        ("hoem", ["home"], '; nearest: "home"'),
        ("j9", ["j1", "elbow"], '; nearest: "j1"'),
        ("x" * 100_000, ["x"], '; known: "x"'),
        ("a", [], "; there is none"),
        ("motor", ["x", "y", "x"], '; known: "x", "y"'),
    ],
)
def test_names_are_suggested_where_they_are_near(name, known, hint):
    assert nearest(name, known) == hint
