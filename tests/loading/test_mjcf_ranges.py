"""Ranges of tendons and ball joints of MJCF files as stops, beside stops of joints and closed forms."""

from __future__ import annotations

import pickle

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.loading.mjcf.ranges import BallBound, TendonBound

TIGHT = {"rtol": 1e-10, "atol": 1e-12, "progress": False}

ROD = '<geom type="capsule" size=".05" fromto="0 0 0 0 0 .5" mass="2"/>'
SUM = '<tendon><fixed name="sum" limited="true" range="-.4 .3">{}</fixed></tendon>'


def load(tmp_path, body, extra="", **options):
    file = tmp_path / "m.xml"
    file.write_text(
        f'<mujoco><compiler angle="radian" autolimits="false"/><worldbody>{body}</worldbody>{extra}</mujoco>'
    )
    return pn.load(file, limits=True, **options)


def hinges(first="", second=""):
    return (
        f'<body><joint name="a" axis="0 1 0" {first}/>{ROD}<body pos="0 0 .5">'
        f'<joint name="b" axis="0 1 0" {second}/>{ROD}</body></body>'
    )


def test_a_fixed_tendon_of_one_joint_is_a_stop_of_the_joint(tmp_path):
    tendon = load(tmp_path, hinges(), SUM.format('<joint joint="a" coef="1"/>'))
    stop = load(tmp_path, hinges(first='limited="true" range="-.4 .3"'))
    assert [c.name for c in tendon.contacts] == ["tendon sum lower", "tendon sum upper"]
    start = {"q": np.array([0.1, 0.2]), "v": np.zeros(2)}
    one, other = (pn.simulate(scene, 1.0, output_dt=0.01, **start, **TIGHT) for scene in (tendon, stop))
    assert one.q[:, 0].max() == pytest.approx(0.3, abs=1e-9)
    assert any(event.kind == "impact" for event in one.events)
    np.testing.assert_allclose(one.q[one.grid], other.q[other.grid], rtol=0.0, atol=1e-6)


def test_a_fixed_tendon_bounds_the_sum_of_its_joints(tmp_path):
    weights = '<joint joint="a" coef="1"/><joint joint="b" coef="-.5"/>'
    scene = load(tmp_path, hinges(), SUM.format(weights))
    run = pn.simulate(scene, 1.0, q=np.array([0.1, 0.2]), v=np.zeros(2), progress=False)
    length = run.q @ [1.0, -0.5]
    assert length.max() == pytest.approx(0.3, abs=1e-8) or length.min() == pytest.approx(-0.4, abs=1e-8)
    assert length.max() < 0.3 + 1e-8
    assert length.min() > -0.4 - 1e-8


def test_a_spatial_tendon_is_a_leash(tmp_path):
    body = """<site name="hook" pos=".3 0 0"/>
        <body><joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
        <geom size=".05" mass="2"/><site name="collar"/></body>"""
    leash = """<tendon><spatial name="leash" limited="true" range="0 .5"><site site="hook"/>
        <site site="collar"/></spatial></tendon>"""
    scene = load(tmp_path, body, leash)
    run = pn.simulate(scene, 1.0, progress=False)
    length = np.hypot(run.q[:, 0] - 0.3, run.q[:, 1])
    assert length.max() == pytest.approx(0.5, abs=1e-8)
    # After the jerk at t = sqrt(2 * 0.4 / 9.81) the body swings on the taut leash.
    strike = next(event for event in run.events if event.kind == "impact")
    assert strike.time == pytest.approx(np.sqrt(0.8 / 9.81), abs=1e-8)
    swing = run.t > strike.time + 1e-6
    speed = np.linalg.norm(run.v[swing], axis=1)
    along = np.array([run.q[swing, 0] - 0.3, run.q[swing, 1]]) / 0.5
    tension = 2.0 * (speed**2 / 0.5 - 9.81 * along[1])
    pulled = -np.einsum("ij,ji->i", pulls(scene, run, swing), along)
    np.testing.assert_allclose(pulled, tension, rtol=1e-6)


def pulls(scene, run, chosen):
    """Forces of the leash on the body: mass times acceleration without weight, (n, 2)."""
    each = [scene.solve(q, v).a for q, v in zip(run.q[chosen], run.v[chosen], strict=True)]
    return 2.0 * (np.array(each) - np.array([0.0, -9.81]))


def test_a_ball_joint_falls_onto_its_range_as_a_hinge_does(tmp_path):
    """An inverted pendulum that tilts about x only; it rests at its largest angle."""
    ball = load(tmp_path, f'<body><joint name="b" type="ball" limited="true" range="0 .6"/>{ROD}</body>')
    hinge = load(tmp_path, f'<body><joint name="b" axis="1 0 0" limited="true" range="-.6 .6"/>{ROD}</body>')
    assert [c.name for c in ball.contacts] == ["b upper"]
    angle = 0.2
    start = np.array([np.sin(angle / 2.0), 0.0, 0.0, np.cos(angle / 2.0)])
    options = {"output_dt": 0.02, **TIGHT}
    one = pn.simulate(ball, 1.5, q=start, v=np.zeros(3), **options)
    other = pn.simulate(hinge, 1.5, q=np.array([angle]), v=np.zeros(1), **options)
    angles = 2.0 * np.arctan2(one.q[:, 0], one.q[:, 3])
    np.testing.assert_allclose(angles[one.grid], other.q[other.grid, 0], rtol=0.0, atol=1e-8)
    assert angles[-1] == pytest.approx(0.6, abs=1e-9)
    weight = 2.0 * 9.81 * 0.25 * np.sin(0.6)
    assert ball.solve(one.q[-1], one.v[-1]).lam[-1] == pytest.approx(weight, rel=1e-6)


def test_derivatives_of_gaps():
    """Rates and second derivatives agree with differences along a motion with constant velocity in v."""
    rng = np.random.default_rng(0)
    model = pin.Model()
    parent = 0
    for name, joint in (("a", pin.JointModelRX()), ("ball", pin.JointModelSpherical())):
        parent = model.addJoint(parent, joint, pin.SE3.Identity(), name)
    bound = BallBound(1, 1, 4, 2.0)
    for _ in range(20):
        q, v = pin.normalize(model, rng.standard_normal(5)), rng.standard_normal(4)
        angle = 2.0 * np.arctan2(np.linalg.norm(q[1:4]), abs(q[4]))
        assert bound.gap(0.0, q) == pytest.approx(
            2.0 * (np.cos(angle / 2.0) - np.cos(1.0)) / np.sin(1.0), abs=1e-12
        )
        h = 1e-4
        gaps = [bound.gap(0.0, pin.integrate(model, q, s * h * v)) for s in (-1.0, 0.0, 1.0)]
        assert bound.rate(0.0, q, v) == pytest.approx((gaps[2] - gaps[0]) / (2.0 * h), abs=1e-6)
        row, b = bound(0.0, q, v, None)
        assert float(row[0] @ v) == pytest.approx(bound.rate(0.0, q, v), abs=1e-12)
        assert -float(b[0]) == pytest.approx((gaps[2] - 2.0 * gaps[1] + gaps[0]) / h**2, abs=1e-5)


def test_unused_ranges_are_noted_and_empty_ones_give_no_stop(tmp_path):
    body = f'<body><joint name="b" type="ball" limited="true" range="0 {{}}"/>{ROD}</body>'
    file = tmp_path / "m.xml"
    for bound, count in ((0.5, 1), (3.2, 0)):
        scene = load(tmp_path, body.format(bound))
        assert len(scene.contacts) == count
    load(tmp_path, body.format(0.5))
    notes = "\n".join(pn.load(file).notes)
    assert 'bounds of ball joints and tendons ("b upper") are not used; limits=True makes them stops' in notes


def test_bounds_survive_pickling(tmp_path):
    scene = load(tmp_path, hinges(), SUM.format('<joint joint="a" coef="1"/>'))
    again = pickle.loads(pickle.dumps(scene))
    assert isinstance(again.contacts[0].function, TendonBound)
