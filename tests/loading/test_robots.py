"""The robots of the package: each loads by name, names its source, and starts with closed loops."""

from __future__ import annotations

import json
from math import cos, sin
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.description.constraints import (
    HingeAnchor,
    JointCoupling,
    KnifeEdge,
    PointAnchor,
    PrescribedMotion,
    Rolling,
)
from pin_nonideal.errors import InputError

from ..support.refusals import refuses

NAMES = [name for name, _ in pn.robots()]
# Robot files hold lengths to 12 digits; a loop of a few of them closes to a few units of the last one.
CLOSED = 1e-11
# The printed initial states hold 16 digits.
ROUNDING = 1e-13


def test_the_robots_are_there():
    assert NAMES == [
        "andrews_squeezer",
        "belt_oscillator",
        "delta",
        "five_bar",
        "four_bar",
        "knife_edge_sleigh",
        "loaded_joint",
        "n_four_bar",
        "panda_friction",
        "panda_settling",
        "rolling_disk",
        "rough_four_bar",
        "slider_crank",
        "solo12_dropped",
        "solo12_standing",
        "worm_drive",
    ]


@pytest.mark.parametrize(("name", "words"), pn.robots())
def test_each_is_described_in_a_line(name, words):
    assert 20 < len(words) < 120, name
    assert "\n" not in words


@pytest.mark.parametrize("name", NAMES)
def test_each_loads_with_source_licence_and_shapes(name):
    scene = pn.load(name)
    assert scene.name == name
    assert scene.source
    assert "BSD-3-Clause" in scene.licence
    assert len(scene.visual_model.geometryObjects) >= 3
    assert scene.constraints or scene.laws or scene.contacts


def place(scene, data, name):
    return data.oMf[scene.model.getFrameId(name)]


def coordinate(scene, joint):
    return scene.q0[scene.model.idx_qs[scene.model.getJointId(joint)]]


@pytest.mark.parametrize("name", NAMES)
def test_each_starts_closed(name):
    scene = pn.load(name)
    data = scene.model.createData()
    pin.framesForwardKinematics(scene.model, data, scene.q0)
    for c in scene.constraints:
        if isinstance(c, PointAnchor) and c.frame2 is not None:
            one, two = (place(scene, data, f) for f in (c.frame1, c.frame2))
            gap = two.actInv(one).translation[["xyz".index(a) for a in c.axes]]
            np.testing.assert_allclose(gap, 0.0, atol=CLOSED)
        elif isinstance(c, HingeAnchor):  # its file leaves the closing of the loop to the projection
            pin.framesForwardKinematics(scene.model, data, scene.initial_state()[0])
            between = place(scene, data, c.frame2).actInv(place(scene, data, c.frame1))
            np.testing.assert_allclose(between.translation, 0.0, atol=CLOSED)
            np.testing.assert_allclose(between.rotation @ c.axis, c.axis, atol=CLOSED)
        elif isinstance(c, PrescribedMotion):
            start = c.function(0.0)
            assert coordinate(scene, c.joint) == pytest.approx(start[0], abs=ROUNDING)
            joint = scene.model.getJointId(c.joint)
            assert scene.v0[scene.model.idx_vs[joint]] == pytest.approx(start[1], abs=ROUNDING)
        elif isinstance(c, JointCoupling):
            gap = coordinate(scene, c.joint1) - c.ratio * coordinate(scene, c.joint2) - c.offset
            assert gap == pytest.approx(0.0, abs=ROUNDING)
        elif isinstance(c, Rolling):  # a disk: its center over the ground
            disk = place(scene, data, c.frame)
            lean = (disk.rotation @ c.axis)[2]
            height = c.radius * np.sqrt(1.0 - lean**2)
            assert disk.translation[2] == pytest.approx(height, abs=CLOSED)
        else:
            held = isinstance(c, KnifeEdge) or c.frame2 is None  # no residual, or zero by definition
            assert held, f"how does a {type(c).__name__} start closed?"


@pytest.mark.parametrize("name", ["four_bar", "slider_crank", "n_four_bar"])
def test_driven_linkages_start_with_speeds_that_keep_them_closed(name):
    scene = pn.load(name)
    model, data = scene.model, scene.model.createData()
    pin.forwardKinematics(model, data, scene.q0, scene.v0)
    pin.updateFramePlacements(model, data)
    assert np.abs(scene.v0).max() > 0.5
    for loop in scene.constraints:
        one, two = (
            pin.getFrameVelocity(model, data, model.getFrameId(f), pin.LOCAL_WORLD_ALIGNED).linear
            for f in (loop.frame1, loop.frame2)
        )
        np.testing.assert_allclose(one, two, atol=CLOSED)


def test_no_position_of_the_four_bar_is_singular():
    scene = pn.load("four_bar")
    lengths = sorted(
        float(np.linalg.norm(f.placement.translation)) for f in scene.model.frames if f.name.endswith("_tip")
    )
    ground = float(scene.model.jointPlacements[scene.model.getJointId("rocker_joint")].translation[0])
    crank = float(scene.model.jointPlacements[scene.model.getJointId("coupler_joint")].translation[0])
    links = sorted([crank, ground, *lengths[-2:]])
    assert links[0] == crank
    assert links[0] + links[3] < links[1] + links[2]  # Grashof, strictly


def andrews(q, v, p):
    """M and the force of the published formulation in (beta, theta, gamma, phi, delta, omega, epsilon)."""
    _, th, _, ph, _, om, _ = q
    bd, td, _, pd, dd, od, ed = v
    r4, r6 = p["e"] - p["ea"], p["zf"] - p["fa"]
    M, f = np.zeros((7, 7)), np.zeros(7)
    M[0, 0] = p["m1"] * p["ra"] ** 2 + p["i1"] + p["i2"]
    M[0, 0] += p["m2"] * (p["rr"] ** 2 - 2 * p["da"] * p["rr"] * cos(th) + p["da"] ** 2)
    M[0, 1] = p["m2"] * (p["da"] ** 2 - p["da"] * p["rr"] * cos(th)) + p["i2"]
    M[1, 1] = p["m2"] * p["da"] ** 2 + p["i2"]
    M[2, 2] = p["m3"] * (p["sa"] ** 2 + p["sb"] ** 2) + p["i3"]
    M[3, 3] = p["m4"] * r4**2 + p["i4"]
    M[3, 4] = p["m4"] * (r4**2 + p["zt"] * r4 * sin(ph)) + p["i4"]
    M[4, 4] = p["m4"] * (p["zt"] ** 2 + 2 * p["zt"] * r4 * sin(ph) + r4**2)
    M[4, 4] += p["m5"] * (p["ta"] ** 2 + p["tb"] ** 2) + p["i4"] + p["i5"]
    M[5, 5] = p["m6"] * r6**2 + p["i6"]
    M[5, 6] = p["m6"] * (r6**2 - p["u"] * r6 * sin(om)) + p["i6"]
    M[6, 6] = p["m6"] * (r6**2 - 2 * p["u"] * r6 * sin(om) + p["u"] ** 2)
    M[6, 6] += p["m7"] * (p["ua"] ** 2 + p["ub"] ** 2) + p["i6"] + p["i7"]
    f[0] = -p["m2"] * p["da"] * p["rr"] * td * (td + 2 * bd) * sin(th)
    f[1] = p["m2"] * p["da"] * p["rr"] * bd**2 * sin(th)
    f[3] = p["m4"] * p["zt"] * r4 * dd**2 * cos(ph)
    f[4] = -p["m4"] * p["zt"] * r4 * pd * (pd + 2 * dd) * cos(ph)
    f[5] = -p["m6"] * p["u"] * r6 * ed**2 * cos(om)
    f[6] = p["m6"] * p["u"] * r6 * od * (od + 2 * ed) * cos(om)
    return np.triu(M) + np.triu(M, 1).T, f


def test_andrews_squeezer_has_the_published_inertia_forces_and_loops():
    scene = pn.load("andrews_squeezer")
    model, data = scene.model, scene.model.createData()
    p = json.loads((Path(__file__).parents[1] / "data" / "andrews_squeezer.json").read_text())["parameters"]
    angles = ("beta", "theta", "gamma", "phi", "delta", "omega", "epsilon")
    order = [model.idx_vs[model.getJointId(n)] for n in angles]
    rng = np.random.default_rng(5)
    q, v = rng.uniform(-2, 2, 7), rng.uniform(-3, 3, 7)
    state, speed = np.zeros(7), np.zeros(7)
    state[order], speed[order] = q, v
    M, f = andrews(q, v, p)
    crba = np.array(pin.crba(model, data, state))
    crba = (np.triu(crba) + np.triu(crba, 1).T)[np.ix_(order, order)]
    # Inertias are sums of a few products of parameters of 3 to 4 digits.
    np.testing.assert_allclose(crba, M, atol=1e-14 * np.abs(M).max())
    force = -pin.nonLinearEffects(model, data, state, speed)[order]
    np.testing.assert_allclose(force, f, atol=1e-13 * np.abs(f).max())
    pin.framesForwardKinematics(model, data, state)
    be, th, ga, ph, de, om, ep = q
    far = p["rr"] * np.array([cos(be), sin(be)]) - p["d"] * np.array([cos(be + th), sin(be + th)])
    g = [
        far - p["ss"] * np.array([sin(ga), -cos(ga)]) - [p["xb"], p["yb"]],
        far - p["e"] * np.array([sin(ph + de), -cos(ph + de)]) - p["zt"] * np.array([cos(de), sin(de)]),
        far - p["zf"] * np.array([cos(om + ep), sin(om + ep)]) - p["u"] * np.array([sin(ep), -cos(ep)]),
    ]
    for gap, loop in zip(g, scene.constraints, strict=True):
        if loop.name != "loop K3":
            gap = gap - [p["xa"], p["ya"]]
        one, two = (place(scene, data, x).translation[:2] for x in (loop.frame1, loop.frame2))
        np.testing.assert_allclose(one - two, gap, atol=ROUNDING)
    (spring,) = scene.forces
    assert (spring.stiffness, spring.rest_length) == (p["c0"], p["l0"])
    d = place(scene, data, spring.frame1).translation[:2]
    np.testing.assert_allclose(
        d,
        [p["sd"] * cos(ga) + p["sc"] * sin(ga) + p["xb"], p["sd"] * sin(ga) - p["sc"] * cos(ga) + p["yb"]],
        atol=ROUNDING,
    )
    np.testing.assert_allclose(
        place(scene, data, spring.frame2).translation[:2], [p["xc"], p["yc"]], atol=ROUNDING
    )
    assert scene.actuation[order[0]] == p["mom"]
    np.testing.assert_array_equal(model.gravity.linear, 0.0)


def test_rolling_disk_starts_in_steady_rolling():
    scene = pn.load("rolling_disk")
    model, data = scene.model, scene.model.createData()
    (rolling,) = scene.constraints
    assert isinstance(rolling, Rolling)
    pin.forwardKinematics(model, data, scene.q0, scene.v0)
    pin.updateFramePlacements(model, data)
    center, spin = place(scene, data, "disk"), data.v[model.getJointId("spin")]
    axis = center.rotation @ [0.0, 1.0, 0.0]
    down = -np.array([0.0, 0.0, 1.0]) + axis[2] * axis
    arm = rolling.radius * down / np.linalg.norm(down)
    assert center.translation[2] + arm[2] == pytest.approx(0.0, abs=ROUNDING)
    velocity = center.rotation @ spin.linear + np.cross(center.rotation @ spin.angular, arm)
    np.testing.assert_allclose(velocity, 0.0, atol=ROUNDING)
    lean, yaw_rate, spin_rate = scene.q0[4], scene.v0[3], scene.v0[5]
    balance = 1.25 * yaw_rate**2 * sin(lean) * cos(lean) + 1.5 * yaw_rate * spin_rate * cos(lean)
    assert balance + 9.81 / rolling.radius * sin(lean) == pytest.approx(0.0, abs=ROUNDING)


def test_solo12_stands_on_level_feet():
    scene = pn.load("solo12_standing")
    assert scene.model.nv == 18
    data = scene.model.createData()
    pin.framesForwardKinematics(scene.model, data, scene.q0)
    heights = [place(scene, data, anchor.frame1).translation[2] for anchor in scene.constraints]
    assert len(heights) == 4
    np.testing.assert_allclose(heights, heights[0], atol=ROUNDING)


def test_delta_platform_starts_level_with_three_degrees_of_freedom():
    scene = pn.load("delta")
    model, data = scene.model, scene.model.createData()
    pin.computeJointJacobians(model, data, scene.q0)
    pin.updateFramePlacements(model, data)
    np.testing.assert_allclose(place(scene, data, "tool").rotation, np.eye(3), atol=CLOSED)
    rows = np.vstack(
        [
            (
                pin.getFrameJacobian(model, data, model.getFrameId(c.frame1), pin.LOCAL_WORLD_ALIGNED)
                - pin.getFrameJacobian(model, data, model.getFrameId(c.frame2), pin.LOCAL_WORLD_ALIGNED)
            )[:3]
            for c in scene.constraints
        ]
    )
    assert model.nv - np.linalg.matrix_rank(rows) == 3


def test_panda_friction_is_half_the_swing_of_the_identified_sigmoid():
    phi1 = [0.54615, 0.87224, 0.64068, 1.2794, 0.83904, 0.30301, 0.56489]
    laws = {law.joint: law for law in pn.load("panda_friction").laws}
    assert len(laws) == 7
    for i, swing in enumerate(phi1, start=1):
        assert laws[f"panda_joint{i}"].coulomb == pytest.approx(swing / 2, rel=1e-5)  # printed to 6 digits


@pytest.mark.parametrize("count", [1, 2, 7])
def test_n_four_bar_has_any_number_of_windows(count):
    scene = pn.load("n_four_bar", N=count, L=0.5, m=2.0, speed=1.5)
    assert scene.model.nv == 2 * count + 1
    assert len(scene.constraints) == count
    depths = [len(s) - 1 for s in scene.model.supports]
    assert max(depths) == 2
    model, data = scene.model, scene.model.createData()
    pin.computeAllTerms(model, data, scene.q0, scene.v0)
    # Energy of the published problem: I phi'^2 / 2 + P with I = (N+1) m L^2 / 3 + N m L^2 and
    # P = ((N+1) m / 2 + N m) g L.
    inertia = ((count + 1) / 3 + count) * 2.0 * 0.25
    assert data.kinetic_energy == pytest.approx(0.5 * inertia * 9.0, rel=ROUNDING)
    assert data.potential_energy == pytest.approx(((count + 1) / 2 + count) * 2.0 * 9.81 * 0.5, rel=ROUNDING)


N_REFUSED = {
    "N": (0, "n_four_bar: N must be at least 1; got 0"),
    "m": (-1.0, "n_four_bar: m must be positive; got -1"),
    "L": (0.0, "n_four_bar: L must be positive; got 0"),
    "g": (float("nan"), "n_four_bar: g must be finite; got nan"),
    "speed": ("fast", "n_four_bar: speed must be a number; got 'fast'"),
}


@pytest.mark.parametrize(("key", "value", "message"), [(k, *v) for k, v in N_REFUSED.items()])
def test_n_four_bar_refuses_bad_parameters(key, value, message):
    with refuses(message, InputError):
        pn.load("n_four_bar", **{key: value})


def test_n_four_bar_without_end():
    with refuses("n_four_bar: N must be at most 10000; got 1000000", InputError):
        pn.load("n_four_bar", N=1_000_000)


def test_unknown_parameter_of_a_generated_robot():
    with refuses('robot "n_four_bar" takes no parameter "M"; known: "N", "m", "L", "g", "speed"', InputError):
        pn.load("n_four_bar", M=3)


@pytest.mark.parametrize(("name", "told"), [("panda", True), ("four_bar", False), ("n_four_bar", False)])
def test_the_report_says_that_limits_of_joints_play_no_part(name, told):
    assert ("limits of joints (the motion may pass them)" in pn.load(name).report()) is told


@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-8, 1e-10, 1e-12])
def test_rough_four_bar_coasts_to_rest(rtol):
    """The linkage passes many dead points of rocker and coupler, at each of which slip in a pin reverses."""
    run = pn.simulate(pn.load("rough_four_bar"), 5.0, rtol=rtol)
    finest = pn.simulate(pn.load("rough_four_bar"), 5.0, rtol=1e-13)
    assert {event.kind for event in run.events[:-4]} == {"reverse"}
    assert [event.kind for event in run.events[-4:]] == ["stick"] * 4
    assert [(e.kind, e.element) for e in run.events] == [(e.kind, e.element) for e in finest.events]
    assert run.events[-1].time == pytest.approx(finest.events[-1].time, abs=10.0 * rtol + 1e-9)
    after = run.t > run.events[-1].time
    np.testing.assert_array_equal(run.v[after], 0.0)
    np.testing.assert_array_equal(run.q[after], np.broadcast_to(run.q[-1], run.q[after].shape))


def test_a_robot_that_is_an_sdf_file_is_refused_with_its_mjcf():
    with pytest.raises(pn.LoadingError) as error:
        pn.load("cassie")
    assert "SDF files are not read" in str(error.value)
    assert 'pn.load("agility_cassie/cassie.xml")' in str(error.value)
