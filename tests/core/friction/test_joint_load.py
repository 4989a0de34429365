"""Load-dependent joint friction against closed forms, for different models of the joint."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ...support.mechanisms import (
    GRAVITY,
    TIGHT,
    TIGHTER,
    assert_close,
    body,
    dof,
    empty,
    frame,
    hinge,
    sample,
)

# Forces of friction follow from a handful of products: relative error of rounding.
FORCE = 1e-12
MASS, INERTIA = 2.0, 0.3
PUSH = np.array([3.0, 5.0, -4.0])  # on the wheel, world axes
ARM = 0.15  # distance of the force along the pin [m]


def friction_of(scene, joint, q, v):
    """Return the generalized friction force at a joint of a tree without other nonideal forces."""
    s = scene.solve(q, v)
    assert_close(s.F_ideal, 0.0, 0.0)
    return s.F_nonideal[dof(scene, joint)]


def wheel(law):
    """A balanced wheel on a pin along y, pushed by PUSH at the distance ARM along the pin."""
    model = empty()
    index = body(model, 0, pin.JointModelRY(), "pin", MASS, inertia=INERTIA * np.eye(3))
    frame(model, "hub", index, pin.SE3(np.eye(3), np.array([0.0, ARM, 0.0])))
    push = pn.Wrench("hub", [*PUSH, 0.0, 0.0, 0.0])
    return pn.Scene(model, laws=[law], forces=[push])


RADIAL = np.hypot(PUSH[0], MASS * GRAVITY - PUSH[2])
AXIAL = PUSH[1]
BENDING = ARM * np.hypot(PUSH[0], PUSH[2])


class TestPinOfAWheel:
    """limit = coulomb + preload + mu (radius (|f_radial| + |m_bending|/span) + axial_radius |f_axial|)."""

    @pytest.mark.parametrize(
        ("law", "torque"),
        [
            ({"mu": 0.2, "radius": 0.05}, 0.2 * 0.05 * RADIAL),
            ({"mu": 0.2, "axial_radius": 0.03}, 0.2 * 0.03 * AXIAL),
            ({"mu": 0.2, "radius": 0.05, "span": 0.4}, 0.2 * 0.05 * (RADIAL + BENDING / 0.4)),
            (
                {
                    "mu": 0.2,
                    "radius": 0.05,
                    "axial_radius": 0.03,
                    "span": 0.4,
                    "coulomb": 0.1,
                    "preload": 0.07,
                },
                0.17 + 0.2 * (0.05 * (RADIAL + BENDING / 0.4) + 0.03 * AXIAL),
            ),
        ],
    )
    @pytest.mark.parametrize("reaction", ["total", "ideal"])
    @pytest.mark.parametrize("rate", [2.0, -7.0])
    def test_torque(self, law, torque, reaction, rate):
        scene = wheel(pn.JointFriction("pin", **law, reaction=reaction))
        friction = friction_of(scene, "pin", [0.4], [rate])
        assert friction == pytest.approx(-np.sign(rate) * torque, rel=FORCE)
        run = pn.simulate(scene, 0.1, v=[rate], record=("forces", "a"))
        np.testing.assert_allclose(run.F_nonideal[:, 0], -np.sign(rate) * torque, rtol=FORCE)
        np.testing.assert_allclose(run.a[:, 0], -np.sign(rate) * torque / INERTIA, rtol=FORCE)
        assert_close(run.v[-1], rate + run.a[0] * 0.1, 1e-12)

    @pytest.mark.parametrize("rate", [0.01, 0.3, -2.0])
    def test_stribeck_and_viscous_parts(self, rate):
        law = {"mu": 0.2, "radius": 0.05, "static_ratio": 1.5, "stribeck_velocity": 0.2, "viscous": 0.04}
        friction = friction_of(wheel(pn.JointFriction("pin", **law)), "pin", [0.0], [rate])
        factor = 1.0 + 0.5 * np.exp(-((rate / 0.2) ** 2))
        torque = 0.2 * 0.05 * RADIAL * factor * np.sign(rate) + 0.04 * rate
        assert friction == pytest.approx(-torque, rel=FORCE)


class TestPendulum:
    """The friction of the pin changes the load of the pin: |f| solves a quadratic equation.

    With f_n = m (l w^2 + g cos th), f_t = c0 - sgn(w) c1 |f|, c1 = mu r m l/J and
    c0 = m g sin th (1 - m l^2/J): (1 - c1^2)|f|^2 + 2 sgn(w) c0 c1 |f| = f_n^2 + c0^2.
    """

    LENGTH, J = 0.5, 0.6
    STATES = ((0.7, 2.0), (0.7, -2.0), (2.5, 0.1), (-1.2, 6.0), (3.1, -0.01))

    def scene(self, mu_r):
        model = empty()
        inertia = (self.J - MASS * self.LENGTH**2) * np.eye(3)
        body(model, 0, hinge(0.0, -1.0, 0.0), "pin", MASS, lever=(0.0, 0.0, -self.LENGTH), inertia=inertia)
        return pn.Scene(model, laws=[pn.JointFriction("pin", mu=2.0 * mu_r, radius=0.5)])

    @pytest.mark.parametrize("mu_r", [0.01, 0.2, 0.54])  # c1 up to 0.9
    @pytest.mark.parametrize(("angle", "rate"), STATES)
    def test_torque(self, mu_r, angle, rate):
        c1 = mu_r * MASS * self.LENGTH / self.J
        c0 = MASS * GRAVITY * np.sin(angle) * (1.0 - MASS * self.LENGTH**2 / self.J)
        f_n = MASS * (self.LENGTH * rate**2 + GRAVITY * np.cos(angle))
        load = np.roots([1.0 - c1**2, 2.0 * np.sign(rate) * c0 * c1, -(f_n**2 + c0**2)]).max()
        friction = friction_of(self.scene(mu_r), "pin", [angle], [rate])
        assert friction == pytest.approx(-np.sign(rate) * mu_r * load, rel=FORCE)

    @pytest.mark.parametrize(("angle", "rate"), STATES)
    def test_paradox(self, angle, rate):
        """With c1 = 1.25 the equation has two solutions or none."""
        with pytest.raises(
            pn.FrictionParadoxError, match=r"has (no|several) solutions? at t = 0 s"
        ) as caught:
            self.scene(0.75).solve([angle], [rate])
        assert caught.value.element == "JointFriction(pin)"
        assert np.isfinite(caught.value.determinant)


@pytest.mark.parametrize("span", [None, 0.25])
def test_slide(span):
    """A guide along x whose load hangs over by d: limit = coulomb + mu (m g + m g d/span)."""
    overhang = 0.3
    model = empty()
    body(model, 0, pin.JointModelPX(), "slide", MASS, lever=(overhang, 0.0, 0.0), inertia=INERTIA * np.eye(3))
    scene = pn.Scene(model, laws=[pn.JointFriction("slide", mu=0.2, span=span, coulomb=0.4)])
    weight = MASS * GRAVITY
    force = 0.4 + 0.2 * (weight + (weight * overhang / span if span else 0.0))
    assert friction_of(scene, "slide", [0.1], [1.5]) == pytest.approx(-force, rel=FORCE)


def test_ball_joint():
    """A top that turns about the vertical on its ball joint: friction mu r m g opposes the spin."""
    model = empty()
    options = {"lever": (0.0, 0.0, 0.2), "inertia": np.diag([0.2, 0.2, 0.1])}
    body(model, 0, pin.JointModelSpherical(), "ball", MASS, **options)
    scene = pn.Scene(model, laws=[pn.JointFriction("ball", mu=0.3, radius=0.04)])
    s = scene.solve([0.0, 0.0, 0.0, 1.0], [0.0, 0.0, -5.0])
    np.testing.assert_allclose(s.F_nonideal, [0.0, 0.0, 0.3 * 0.04 * MASS * GRAVITY], rtol=FORCE, atol=1e-14)


LAW = {"mu": 0.25, "radius": 0.06, "axial_radius": 0.04, "span": 0.3, "viscous": 0.05, "coulomb": 0.1}
LAWS = [
    {**LAW, "static_ratio": 1.2},
    {**LAW, "reaction": "ideal"},
    {"mu": 0.5, "radius": 0.1},
    {**LAW, "static_ratio": 1.5, "stribeck_velocity": 0.3},
]


class TestLawsThatLoad:
    """A law that acts on bodies loads the joints between them and the ground."""

    def test_drag(self):
        """A wheel on a pin along y is dragged at its hub, off the axis, by the air that it moves through."""
        coefficient, radius, rate = 3.0, 0.4, 6.0
        model = empty(gravity=(0.0, 0.0, 0.0))
        index = body(model, 0, pin.JointModelRY(), "pin", MASS, inertia=INERTIA * np.eye(3))
        frame(model, "vane", index, pin.SE3(np.eye(3), np.array([radius, 0.0, 0.0])))
        law = pn.JointFriction("pin", mu=0.2, radius=0.05, name="rub")
        scene = pn.Scene(model, laws=[pn.Drag("vane", coefficient, 1.0), law])
        drag = coefficient * radius * rate  # across the lever; the balanced wheel hangs on the pin alone
        a = scene.solve([0.3], [rate]).a[0]
        assert a == pytest.approx(-(radius * drag + 0.2 * 0.05 * drag) / INERTIA, rel=FORCE)

    def test_viscous_hinge(self):
        """An arm on a guide is turned in a hinge anchor, whose viscous torque the guide must carry."""
        viscous, rate, span, mu = 0.7, 4.0, 0.5, 0.1
        model = empty(gravity=(0.0, 0.0, 0.0))
        slide = body(model, 0, pin.JointModelPX(), "guide", 1.0, inertia=0.1 * np.eye(3))
        wheel = body(model, 0, pin.JointModelFreeFlyer(), "wheel", MASS, inertia=INERTIA * np.eye(3))
        frame(model, "axle", slide)
        frame(model, "hub", wheel)
        anchor = pn.HingeAnchor("hub", "axle", axis="y", name="hinge")
        laws = [
            pn.JointFriction("hinge", viscous=viscous, name="oil"),
            pn.JointFriction("guide", mu=mu, span=span, name="rub"),
        ]
        scene = pn.Scene(model, constraints=[anchor], laws=laws)
        v = np.array([1.0, 1.0, 0.0, 0.0, 0.0, rate, 0.0])
        a = scene.solve(scene.q0, v).a
        assert a[0] == pytest.approx(-mu * viscous * rate / span / (1.0 + MASS), rel=FORCE)
        assert a[5] == pytest.approx(-viscous * rate / INERTIA, rel=FORCE)


class OnePin:
    """Arm on a skew pin, at 1.9 rad from its hanging position, as different models of the same mechanics.

    Each returns the scene, and functions of q and v that give angle and rate about the pin.
    """

    START = 1.9
    ARM = pin.Inertia(
        2.0,
        np.array([0.1, 0.05, -0.5]),
        np.array([[0.2, 0.01, 0.02], [0.01, 0.25, -0.03], [0.02, -0.03, 0.15]]),
    )
    PLACE = pin.SE3(pin.utils.rotate("x", 0.4) @ pin.utils.rotate("z", 0.3), np.array([0.2, -0.1, 1.0]))

    def __init__(self, law):
        self.law = pn.JointFriction("pin", **law, name="rub")
        self.start = pin.SE3ToXYZQUAT(self.PLACE * pin.SE3(pin.utils.rotate("y", self.START), np.zeros(3)))

    def turned(self, q):
        """Angle about the pin of free bodies, from their quaternions."""
        places = (pin.Quaternion(x[3:7]).toRotationMatrix() for x in q)
        return np.array([pin.log3(self.PLACE.rotation.T @ R)[1] for R in places])

    def free_arm(self):
        model = empty()
        index = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "arm")
        model.appendBodyToJoint(index, self.ARM, pin.SE3.Identity())
        frame(model, "arm_pin", index)
        frame(model, "ground_pin", 0, self.PLACE)
        return model, index

    def tree(self, sign=1.0):
        model = empty()
        index = model.addJoint(0, hinge(0.0, sign, 0.0), self.PLACE, "pin")
        model.appendBodyToJoint(index, self.ARM, pin.SE3.Identity())
        scene = pn.Scene(model, laws=[self.law], q0=[sign * self.START])
        return scene, lambda q: sign * q[:, 0], lambda v: sign * v[:, 0]

    def tree_about_the_opposite_axis(self):
        return self.tree(-1.0)

    def cut(self, frames=("arm_pin", "ground_pin")):
        """The arm is free, a hinge anchor holds it."""
        model, _ = self.free_arm()
        anchor = pn.HingeAnchor(*frames, axis="y", name="pin")
        scene = pn.Scene(model, constraints=[anchor], laws=[self.law], q0=self.start)
        return scene, self.turned, lambda v: v[:, 4]

    def cut_seen_from_the_ground(self):
        return self.cut(("ground_pin", "arm_pin"))

    def cut_at_the_world(self):
        return self.cut(("arm_pin",))

    def reversed_tree(self):
        """The arm is the root, the ground hangs on it by the pin and is welded to the world."""
        model, index = self.free_arm()
        options = {"lever": (0.2, 0.1, 0.3), "inertia": np.diag([0.1, 0.2, 0.15])}
        body(model, index, pin.JointModelRY(), "pin", 1.3, **options)
        weld = pn.FrameAnchor("pin", "ground_pin")
        scene = pn.Scene(model, constraints=[weld], laws=[self.law], q0=[*self.start, -self.START])
        return scene, lambda q: -q[:, 7], lambda v: -v[:, 6]


OTHERS = [
    OnePin.tree_about_the_opposite_axis,
    OnePin.cut,
    OnePin.cut_seen_from_the_ground,
    OnePin.cut_at_the_world,
    OnePin.reversed_tree,
]


class TestOnePinInManyModels:
    SAME = 1e-10
    DURATION, OUTPUT = 6.0, 0.1

    @pytest.mark.parametrize("other", OTHERS)
    @pytest.mark.parametrize("law", LAWS)
    def test_same_motion(self, law, other):
        runs = []
        for build in (OnePin.tree, other):
            scene, angle, rate = build(OnePin(law))
            run = pn.simulate(scene, self.DURATION, output_dt=self.OUTPUT, **TIGHTER)
            at = [sample(run, k * self.OUTPUT) for k in range(61)]
            runs.append((angle(run.q)[at], rate(run.v)[at], run.events))
        (angles, rates, events), (other_angles, other_rates, other_events) = runs
        assert [event.kind for event in events] == [event.kind for event in other_events]
        assert len(events) >= 4
        assert_close([event.time for event in other_events], [event.time for event in events], self.SAME)
        assert_close(other_angles, angles, self.SAME)
        assert_close(other_rates, rates, self.SAME)

    @pytest.mark.parametrize("other", OTHERS)
    def test_same_rest(self, other):
        """Under heavy friction all models come to rest at the same place."""
        law = {**LAW, "coulomb": 1.5, "static_ratio": 1.2}
        angles = []
        for build in (OnePin.tree, other):
            scene, angle, rate = build(OnePin(law))
            run = pn.simulate(scene, 10.0, **TIGHT)
            assert run.events[-1].kind == "stick"
            assert_close(rate(run.v)[-1], 0.0, 1e-13)
            angles.append(angle(run.q)[-1])
        assert_close(angles[1], angles[0], self.SAME)

    @pytest.mark.parametrize("other", OTHERS)
    @pytest.mark.parametrize("law", LAWS)
    def test_same_acceleration(self, law, other):
        """All models have the same acceleration at 3 rad/s."""
        accelerations = []
        for build in (OnePin.tree, other):
            scene, _, rate = build(OnePin(law))
            v = np.zeros(scene.model.nv)
            v[{1: 0, 6: 4, 7: 4}[scene.model.nv]] = 3.0
            if scene.model.nv == 7:
                v[6] = -3.0
            if build is OnePin.tree_about_the_opposite_axis:
                v[0] = -3.0
            accelerations.append(rate(scene.solve(scene.q0, v).a[None])[0])
        assert accelerations[1] == pytest.approx(accelerations[0], rel=1e-11)
