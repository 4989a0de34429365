"""Resultants of the contact points of two shapes, beside statics by hand."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

G, MASS, EDGE = 9.81, 4.0, 0.2


def stack(count: int, **options: object) -> pn.Scene:
    """Return boxes on each other on the ground, turned against each other."""
    model, shapes = pin.Model(), pin.GeometryModel()
    shapes.addGeometryObject(pn.ground())
    for k in range(count):
        place = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, 0.2 * k), np.array([0.0, 0.0, (k + 0.5) * EDGE]))
        shape = coal.Box(EDGE, EDGE, EDGE)
        pn.free_body(model, f"box {k}", shape, mass=MASS, collision_model=shapes, place=place)
    contacts = [pn.GeometryContact("box 0", "ground", mu=0.6)]
    contacts += [pn.GeometryContact(f"box {k}", f"box {k - 1}", mu=0.6) for k in range(1, count)]
    return pn.Scene(model, contacts=contacts, collision_model=shapes, **options)


@pytest.mark.parametrize("method", ["moreau", "dop853"])
def test_each_box_carries_the_weight_above(method: str) -> None:
    steps = {"dt": 1e-3} if method == "moreau" else {}
    run = pn.simulate(stack(3), 0.01, method=method, record="forces", **steps)
    for k in range(3):
        under = run.contact(f"box {k} on {'ground' if k == 0 else f'box {k - 1}'}")
        assert under.bodies == (f"box {k}", f"box {k - 1}" if k else "universe")
        load = (3 - k) * MASS * G
        np.testing.assert_allclose(under.force, np.outer(np.ones(len(run)), [0.0, 0.0, load]), atol=1e-7)
        np.testing.assert_allclose(under.normal_force, load, rtol=1e-9)
        np.testing.assert_allclose(under.center, [[0.0, 0.0, k * EDGE]] * len(run), atol=1e-4)
        np.testing.assert_allclose(under.torque, 0.0, atol=1e-3 * load * EDGE)
        assert under.closed.all()
        assert np.abs(under.gap).max() < 1e-12


def test_a_push_moves_the_center_of_pressure() -> None:
    push = 10.0  # below mu m g, at the middle of the box
    run = pn.simulate(
        stack(1, actuation=lambda t, q, v: np.array([push, 0.0, 0.0, 0.0, 0.0, 0.0])), 0.01, record="forces"
    )
    foot = run.contact("box 0 on ground")
    np.testing.assert_allclose(foot.force, [[-push, 0.0, MASS * G]] * len(run), atol=1e-8)
    np.testing.assert_allclose(foot.center[:, 0], push * 0.5 * EDGE / (MASS * G), rtol=1e-7)
    # Moments about the center of the box vanish.
    moments = foot.torque + np.cross(foot.center - run.q[:, :3] - [0.0, 0.0, 0.5 * EDGE], foot.force)
    np.testing.assert_allclose(moments, 0.0, atol=1e-8)


def test_open_contacts_have_a_gap_and_no_center() -> None:
    scene = stack(1).replace(q0=np.array([0.0, 0.0, 0.3, 0.0, 0.0, 0.0, 1.0]))
    foot = pn.simulate(scene, 0.05, record="forces").contact("box 0 on ground")
    assert not foot.closed.any()
    assert foot.gap[0] == pytest.approx(0.3, abs=1e-14)
    assert np.isnan(foot.center).all()
    assert not foot.force.any()
    assert not foot.torque.any()


def test_the_point_of_a_ball_is_a_contact_of_one_point() -> None:
    model, shapes = pin.Model(), pin.GeometryModel()
    shapes.addGeometryObject(pn.ground())
    pn.free_body(model, "ball", coal.Sphere(0.1), mass=1.0, collision_model=shapes, place=(0.3, 0.0, 0.1))
    scene = pn.Scene(model, contacts=pn.ground_contacts(model, shapes), collision_model=shapes)
    ball = pn.simulate(scene, 0.01, record="forces").contact("ball on ground")
    assert ball.points == ["ball on ground"]
    assert ball.bodies == ("ball", "universe")
    np.testing.assert_allclose(ball.center, [[0.3, 0.0, 0.0]] * len(ball.gap), atol=1e-12)
    np.testing.assert_allclose(ball.force[:, 2], G, rtol=1e-12)


def test_errors_name_the_pair_and_the_record() -> None:
    scene = stack(1)
    with pytest.raises(pn.InputError, match=r'contact\("box 0 on ground"\) needs a run with record="forces"'):
        pn.simulate(scene, 0.01).contact("box 0 on ground")
    run = pn.simulate(scene, 0.01, record=("forces", "reactions"))
    with pytest.raises(pn.UnknownNameError, match=r'no contact "box on ground".*nearest: "box 0 on ground"'):
        run.contact("box on ground")
    with pytest.raises(pn.UnknownNameError, match=r'no constraint or contact "box 0 on ground 1"'):
        run.force("box 0 on ground 1")
    with pytest.raises(
        pn.InputError, match=r'run\.contact_points was not recorded; pass record="contact_points"'
    ):
        run.contact_points["box 0 on ground"]
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "lift")
    model.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Identity())
    stop = pn.Scene(model, contacts=[pn.JointLimit("lift", lower=0.0, name="stop")])
    with pytest.raises(pn.InputError, match=r'contact\("stop lower"\) has no contact point; see run.force'):
        pn.simulate(stop, 0.01, record="forces").contact("stop lower")


def test_numbered_contacts_of_the_user_are_no_pair() -> None:
    """The forces of different contacts would cancel or add without a meaning."""
    scene = stack(2)
    feet = [pn.PointContact(f"box {k}", height=-1.0, name=f"foot {k}") for k in range(2)]
    run = pn.simulate(scene.replace(add_contacts=feet), 0.01, record="forces")
    with pytest.raises(pn.UnknownNameError, match='no contact "foot" in this run; nearest: "foot'):
        run.contact("foot")
    assert run.contact("foot 1").bodies == ("box 1", "universe")
