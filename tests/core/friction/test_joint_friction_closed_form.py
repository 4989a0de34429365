"""Friction of ball anchors, universal and planar joints, and floating bodies, against closed forms."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ...support.mechanisms import GRAVITY, TIGHT, TIGHTER, again, assert_close, body, empty, frame, sample
from ...support.random_trees import inertia, placement

# Forces of friction follow from a handful of products: relative error of rounding.
FORCE = 1e-12
# Error of accelerations by an implicit equation, against Pinocchio's inverse dynamics of the same motion.
INVERSE = 1e-10
LAW = {"mu": 0.2, "radius": 0.03, "axial_radius": 0.02, "span": 0.4, "coulomb": 0.1, "preload": 0.05}


def random_chain(kind, rng, **law):
    """A revolute joint, the joint "place" of a kind with friction, and a ball joint after it."""
    model = empty(rng.normal(0.0, 6.0, 3))
    index = 0
    for name, joint in (("root", pin.JointModelRY()), ("place", kind), ("end", pin.JointModelSpherical())):
        index = model.addJoint(index, joint, placement(rng), name)
        model.appendBodyToJoint(index, inertia(rng, rng.uniform(0.3, 2.0)), pin.SE3.Identity())
    scene = pn.Scene(model, laws=[pn.JointFriction("place", **law)])
    q = pin.integrate(model, pin.neutral(model), rng.standard_normal(model.nv))
    return scene, q, rng.standard_normal(model.nv)


def reaction(scene, q, v, a):
    """Wrench of the joint "place" in its frame, by Pinocchio's inverse dynamics."""
    data = scene.model.createData()
    pin.rnea(scene.model, data, q, v, a)
    return data.f[scene.model.getJointId("place")]


def on_grid(run):
    """Samples at multiples of 0.1 s, once each."""
    return [sample(run, 0.1 * k) for k in range(round(run.t[-1] / 0.1) + 1)]


def across(vector, axis):
    return np.linalg.norm(vector - (vector @ axis) * axis)


@pytest.mark.parametrize("terms", ["core", "pinocchio"])
@pytest.mark.parametrize("seed", range(8))
class TestLoads:
    def test_universal(self, seed, terms):
        """Each axis of the cross is a bearing: mu (radius (|f_r| + |m_b|/span) + axial_radius |f_a|)."""
        rng = np.random.default_rng(seed)
        cross = pin.JointModelUniversal(np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.6, 0.8]))
        scene, q, v = random_chain(cross, rng, **LAW, viscous=0.04)
        scene = again(scene, terms=terms)
        s = scene.solve(q, v)
        wrench = reaction(scene, q, v, s.a)
        joint = scene.model.joints[2]
        turn = joint.createData()
        joint.calc(turn, q)
        for k, axis in enumerate(np.asarray(turn.S)[3:].T):
            radial, bending = across(wrench.linear, axis), across(wrench.angular, axis)
            limit = 0.15 + 0.2 * (0.03 * (radial + bending / 0.4) + 0.02 * abs(wrench.linear @ axis))
            rate = v[joint.idx_v + k]
            assert s.F_nonideal[joint.idx_v + k] == pytest.approx(
                -limit * np.sign(rate) - 0.04 * rate, rel=INVERSE
            )
        assert scene.element_names == ["JointFriction(place) axis 1", "JointFriction(place) axis 2"]

    def test_planar(self, seed, terms):
        """Friction mu (|f_n| + |m_b|/span) opposes the slide, and radius times that opposes the turn."""
        rng = np.random.default_rng(seed)
        law = {"mu": 0.2, "span": 0.4, "coulomb": 0.3, "viscous": 0.05, "radius": 0.08}
        scene, q, v = random_chain(pin.JointModelPlanar(), rng, **law)
        scene = again(scene, terms=terms)
        s = scene.solve(q, v)
        wrench = reaction(scene, q, v, s.a)
        limit = 0.3 + 0.2 * (abs(wrench.linear[2]) + np.linalg.norm(wrench.angular[:2]) / 0.4)
        slide, turn = v[1:3], v[3]
        force = -limit * slide / np.linalg.norm(slide) - 0.05 * slide
        torque = -0.08 * limit * np.sign(turn) - 0.05 * 0.08**2 * turn
        np.testing.assert_allclose(s.F_nonideal[1:4], [*force, torque], rtol=INVERSE)
        assert [name.split()[-1] for name in scene.element_names] == ["sliding", "turning"]

    def test_translation(self, seed, terms):
        rng = np.random.default_rng(seed)
        scene, q, v = random_chain(pin.JointModelTranslation(), rng, coulomb=0.3, viscous=0.05)
        s = again(scene, terms=terms).solve(q, v)
        slide = v[1:4]
        expected = -0.3 * slide / np.linalg.norm(slide) - 0.05 * slide
        np.testing.assert_allclose(s.F_nonideal[1:4], expected, rtol=INVERSE)


def hanging(law, *, anchor, angles=(0.3, -0.2, 0.5), rate=(0.0, 0.0, 0.0), kinds=pn.PointAnchor, **options):
    """A body hung at the origin by a ball: a joint of the tree, or an anchor of a body that floats."""
    model = empty()
    lever, moment = (0.1, 0.0, -0.4), np.diag([0.2, 0.25, 0.1])
    turn = pin.rpy.rpyToMatrix(*angles)
    q = pin.Quaternion(turn).coeffs()
    if not anchor:
        body(model, 0, pin.JointModelSpherical(), "ball", 2.0, lever=lever, inertia=moment)
        return pn.Scene(model, laws=law("ball"), q0=q, v0=rate, **options)
    index = body(model, 0, pin.JointModelFreeFlyer(), "body", 2.0, lever=lever, inertia=moment)
    frame(model, "socket", index)
    tie = kinds("socket", name="ball")
    q0, v0 = [0.0, 0.0, 0.0, *q], [0.0, 0.0, 0.0, *rate]
    return pn.Scene(model, constraints=[tie], laws=law("ball"), q0=q0, v0=v0, **options)


class TestBallAnchor:
    @pytest.mark.parametrize(
        "law",
        [
            {"mu": 0.3, "radius": 0.04},
            {
                "mu": 0.3,
                "radius": 0.04,
                "viscous": 0.05,
                "coulomb": 0.1,
                "static_ratio": 1.4,
                "stribeck_velocity": 0.5,
            },
            {"mu": 0.3, "radius": 0.04, "reaction": "ideal"},
            {"viscous": 0.1},
        ],
    )
    def test_is_that_of_the_joint(self, law):
        """A ball joint and a ball anchor have the same motion, friction and events."""

        def laws(name):
            return [pn.JointFriction(name, **law, name="rub")]

        runs = [
            pn.simulate(
                hanging(laws, anchor=anchor, rate=(1.0, -2.0, 3.0)),
                2.0,
                output_dt=0.1,
                record="energy",
                **TIGHT,
            )
            for anchor in (False, True)
        ]
        joint, anchor = runs
        assert [e.kind for e in joint.events] == [e.kind for e in anchor.events]
        assert_close(anchor.q[on_grid(anchor), 3:], joint.q[on_grid(joint)], 1e-8)
        assert anchor.energy["rub"][-1] == pytest.approx(joint.energy["rub"][-1], rel=1e-8)
        assert joint.energy["rub"][-1] < -1.0

    def test_spin_about_the_vertical(self):
        """Friction |C| = mu radius m g opposes the angular velocity."""
        model = empty()
        index = body(
            model,
            0,
            pin.JointModelFreeFlyer(),
            "top",
            2.0,
            lever=(0, 0, 0.2),
            inertia=np.diag([0.2, 0.2, 0.1]),
        )
        frame(model, "tip", index)
        law = pn.JointFriction("ball", mu=0.3, radius=0.04)
        scene = pn.Scene(model, constraints=[pn.PointAnchor("tip", name="ball")], laws=[law])
        s = scene.solve(pin.neutral(model), [0, 0, 0, 0, 0, -5.0])
        assert s.a[5] == pytest.approx(0.3 * 0.04 * 2.0 * GRAVITY / 0.1, rel=FORCE)

    @pytest.mark.parametrize("anchor", [False, True])
    @pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.6, 0.0, 0.8), (0.48, 0.6, 0.64)])
    def test_sticks_up_to_its_own_limit(self, anchor, axis):
        """A balanced body under a torque T about any axis holds to T = mu r m g, then turns about it."""
        limit = 0.3 * 0.04 * 2.0 * GRAVITY
        for share in (1.0 - 1e-9, 1.0 + 1e-3):
            model = empty()
            kind = pin.JointModelFreeFlyer() if anchor else pin.JointModelSpherical()
            index = body(model, 0, kind, "ball", 2.0, inertia=0.2 * np.eye(3))
            frame(model, "middle", index)
            ties = [pn.PointAnchor("middle", name="tie")] if anchor else []
            law = pn.JointFriction("tie" if anchor else "ball", mu=0.3, radius=0.04)
            push = pn.Wrench("middle", [0, 0, 0, *(share * limit * np.array(axis))])
            scene = pn.Scene(model, constraints=ties, laws=[law], forces=[push])
            s = scene.solve(pin.neutral(model), np.zeros(model.nv))
            if share < 1.0:
                assert list(s.modes) == [0]
                run = pn.simulate(scene, 10.0)
                assert_close(run.v[-1], 0.0, 0.0 if not anchor else 1e-15)
            else:
                assert list(s.modes) == [1]
                assert_close(s.a[-3:], 1e-3 * limit / 0.2 * np.array(axis), 1e-12)

    def test_models_of_pinocchio(self):
        """The ball of `pin.RigidConstraintModel` rubs like that of a PointAnchor."""

        def laws(name):
            return [pn.JointFriction(name, mu=0.3, radius=0.04)]

        ours = hanging(laws, anchor=True, rate=(1.0, -2.0, 3.0))
        theirs = pin.RigidConstraintModel(
            pin.ContactType.CONTACT_3D, ours.model, 1, pin.SE3.Identity(), 0, pin.SE3.Identity()
        )
        theirs.name = "ball"
        scene = again(ours, constraints=[theirs])
        assert_close(scene.acceleration(ours.q0, ours.v0), ours.acceleration(ours.q0, ours.v0), 1e-11)

    def test_in_a_plane(self):
        """In a planar linkage a ball turns about the normal of the plane alone: a hinge of that radius."""
        model = empty()
        joint = 0
        for k, length in enumerate((0.0, 0.3, 0.8)):
            place = pin.SE3(np.eye(3), np.array([length, 0.0, 0.0]))
            joint = body(
                model,
                joint,
                pin.JointModelRY(),
                f"pin{k}",
                1.0,
                place=place,
                lever=(0.2, 0, 0),
                inertia=0.01 * np.eye(3),
            )
        frame(model, "tip", joint, pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.0])))
        frame(model, "ground", 0, pin.SE3(np.eye(3), np.array([0.7, 0.0, 0.0])))
        hinge = pn.HingeAnchor("tip", "ground", axis="y")
        q, v = pn.Scene(model, constraints=[hinge]).project([-1.0, 1.2, 1.0], [2.0, 0.0, 0.0])
        runs = []
        for tie in (
            pn.PointAnchor("tip", "ground", name="tie"),
            pn.HingeAnchor("tip", "ground", axis="y", name="tie"),
        ):
            law = pn.JointFriction("tie", mu=0.3, radius=0.05, name="rub")
            scene = pn.Scene(model, constraints=[tie], laws=[law], q0=q, v0=v)
            runs.append(pn.simulate(scene, 3.0, output_dt=0.1, record="energy", **TIGHTER))
        ball, hinge = runs
        assert_close(ball.q[on_grid(ball)], hinge.q[on_grid(hinge)], 1e-8)
        assert [(e.kind, pytest.approx(e.time, abs=1e-7)) for e in hinge.events] == [
            (e.kind, e.time) for e in ball.events
        ]


class TestPuck:
    """A puck on a planar joint: it slides v^2/(2 mu g) far and turns for J w/(mu radius m g)."""

    MU, RADIUS, J = 0.3, 0.05, 0.004

    def scene(self, v, **law):
        model = empty()
        body(model, 0, pin.JointModelPlanar(), "puck", 2.0, inertia=np.diag([0.002, 0.002, self.J]))
        return pn.Scene(
            model,
            laws=[pn.JointFriction("puck", **{"mu": self.MU, "radius": self.RADIUS, **law}, name="ice")],
            v0=v,
        )

    @pytest.mark.parametrize("angle", [0.0, 1.0, 2.5])
    @pytest.mark.parametrize("rate", [0.0, 12.0, -12.0])
    def test_comes_to_rest(self, angle, rate):
        speed = 1.5
        direction = np.array([np.cos(angle), np.sin(angle)])
        run = pn.simulate(self.scene([*(speed * direction), rate]), 3.0, record="energy", **TIGHTER)
        assert_close(run.q[-1][:2], speed**2 / (2.0 * self.MU * GRAVITY) * direction, 1e-9)
        stops = {e.element: e.time for e in run.events if e.kind == "stick"}
        assert stops["ice sliding"] == pytest.approx(speed / (self.MU * GRAVITY), abs=1e-9)
        if rate:
            turning = self.J * abs(rate) / (self.MU * self.RADIUS * 2.0 * GRAVITY)
            assert stops["ice turning"] == pytest.approx(turning, abs=1e-9)
        assert_close(run.v[-1], 0.0, 0.0)
        kinetic = 0.5 * 2.0 * speed**2 + 0.5 * self.J * rate**2
        assert run.energy["ice"][-1] == pytest.approx(-kinetic, rel=1e-9)

    def test_without_radius_it_turns_freely(self):
        run = pn.simulate(self.scene([0.0, 0.0, 3.0], radius=0.0), 2.0, **TIGHT)
        assert_close(run.v[-1, 2], 3.0, 1e-12)

    def test_stribeck_of_the_turn_follows_the_speed_at_the_radius(self):
        law = {"static_ratio": 1.5, "stribeck_velocity": 0.2}
        s = self.scene([0.0, 0.0, 3.0], **law).solve([0, 0, 1, 0], [0.0, 0.0, 3.0])
        factor = 1.0 + 0.5 * np.exp(-((3.0 * self.RADIUS / 0.2) ** 2))
        assert s.F_nonideal[2] == pytest.approx(-self.MU * self.RADIUS * 2.0 * GRAVITY * factor, rel=FORCE)

    def test_table_that_tilts(self):
        """A body on a tilted table holds until tan(slope) = mu, for every direction of the slope."""
        slope = np.arctan(self.MU)
        for share, mode in ((0.999, 0), (1.001, 1)):
            for way in (0.0, 0.7, 2.0):
                turn = pin.rpy.rpyToMatrix(0.0, 0.0, way) @ pin.rpy.rpyToMatrix(0.0, share * slope, 0.0)
                model = empty()
                body(
                    model,
                    0,
                    pin.JointModelPlanar(),
                    "puck",
                    2.0,
                    place=pin.SE3(turn, np.zeros(3)),
                    inertia=0.01 * np.eye(3),
                )
                scene = pn.Scene(model, laws=[pn.JointFriction("puck", mu=self.MU, radius=self.RADIUS)])
                assert list(scene.solve([0, 0, 1, 0], [0, 0, 0]).modes) == [mode, 0]


def test_a_body_that_floats():
    """Constant friction in 3 + 3 directions: v/(c/m) and w/(c radius/J), for any direction of flight."""
    model = empty((0.0, 0.0, 0.0))
    body(model, 0, pin.JointModelFreeFlyer(), "float", 2.0, inertia=0.1 * np.eye(3))
    law = pn.JointFriction("float", coulomb=0.5, radius=0.2, name="fluid")
    v = np.array([0.3, -0.4, 1.2, 0.5, 0.2, -0.6])
    run = pn.simulate(pn.Scene(model, laws=[law], v0=v), 10.0, record="energy", **TIGHTER)
    stops = {e.element: e.time for e in run.events if e.kind == "stick"}
    assert stops["fluid sliding"] == pytest.approx(np.linalg.norm(v[:3]) * 2.0 / 0.5, rel=1e-8)
    assert stops["fluid turning"] == pytest.approx(np.linalg.norm(v[3:]) * 0.1 / (0.5 * 0.2), rel=1e-8)
    assert_close(run.v[-1], 0.0, 0.0)
    assert run.energy["fluid"][-1] == pytest.approx(-run.energy["kinetic"][0], rel=1e-9)
