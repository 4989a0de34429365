"""Validation of descriptions: valid values are normalized, invalid values raise an error with the reason."""

from __future__ import annotations

import dataclasses
import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pin_nonideal import validation as checks
from pin_nonideal.description.actuation import HoldPosition, SampledControl, Table
from pin_nonideal.description.constraints import (
    Distance,
    FrameAnchor,
    HingeAnchor,
    JointCoupling,
    KnifeEdge,
    PointAnchor,
    PrescribedMotion,
    Rolling,
    UserConstraint,
)
from pin_nonideal.description.contacts import PointContact
from pin_nonideal.description.forces import JointSpring, SpringDamper, UserForce, Wrench
from pin_nonideal.description.laws import Drag, JointFriction, LuGre, SigmoidFriction, UserFriction, UserLaw
from pin_nonideal.description.time_functions import sinusoid
from pin_nonideal.errors import InputError


def nothing(*_):
    return None


ACCEPTED = [
    PointAnchor("a", "b", axes="zx", name="loop"),
    FrameAnchor("a"),
    HingeAnchor("a", "b", axis="x"),
    Distance("a", "b", 0.5),
    JointCoupling("j", "k", ratio=-2),
    PrescribedMotion("j", sinusoid(1, 2)),
    KnifeEdge("a"),
    Rolling("a", 0.5),
    UserConstraint(nothing, 2),
    JointFriction("j", mu=0.1, radius=0.02),
    SigmoidFriction("j", 0.5, 5),
    LuGre("j", 1e5, 300, 1),
    Drag("a", 0.3),
    UserLaw(nothing),
    UserFriction(nothing, nothing),
    PointContact("a", mu=0.5),
    SpringDamper("a", "b", stiffness=10),
    JointSpring("j", 2.0),
    Wrench("a", [0, 0, 1, 0, 0, 0]),
    UserForce(nothing),
    SampledControl(nothing, 0.01),
    HoldPosition(10, 1),
    Table([0, 1], [[0.0, 1.0], [2.0, 3.0]]),
]


@pytest.mark.parametrize("description", ACCEPTED, ids=lambda d: type(d).__name__)
def test_descriptions_are_frozen_and_take_a_name(description):
    with pytest.raises(dataclasses.FrozenInstanceError):
        description.name = "other"
    assert dataclasses.replace(description, name="another").name == "another"
    with pytest.raises(InputError, match=f"^{type(description).__name__}: name must be a name"):
        dataclasses.replace(description, name=3)
    with pytest.raises(InputError, match=f"^{type(description).__name__}: name must be a name; got an empty"):
        dataclasses.replace(description, name="")


def test_axes_are_ordered():
    assert PointAnchor("a", axes="zx").axes == "xz"


@pytest.mark.parametrize(
    ("axis", "unit"),
    [
        ("x", (1.0, 0.0, 0.0)),
        ("z", (0.0, 0.0, 1.0)),
        ([0, 3, 4], (0.0, 0.6, 0.8)),
        (np.array([0.0, -2e-200, 0.0]), (0.0, -1.0, 0.0)),
        ((1e200, 0.0, 1e200), (math.sqrt(0.5), 0.0, math.sqrt(0.5))),
    ],
)
def test_axes_become_unit_vectors(axis, unit):
    for description in (HingeAnchor("a", axis=axis), KnifeEdge("a", axis=axis)):
        assert description.axis == pytest.approx(unit, rel=1e-15)
    assert Rolling("a", 0.5, normal=axis).normal == pytest.approx(unit, rel=1e-15)
    assert PointContact("a", normal=axis).normal == pytest.approx(unit, rel=1e-15)


def test_axis_triads_of_the_coordinate_axes_are_cyclic():
    x, y, z = checks.AXES["x"], checks.AXES["y"], checks.AXES["z"]
    assert checks.axis_triad(z) == (x, y, z)
    assert checks.axis_triad(x) == (y, z, x)
    assert checks.axis_triad(y) == (z, x, y)


@given(st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: math.hypot(*v) > 1e-3))
def test_axis_triads_are_right_handed_and_orthonormal(vector):
    axis = checks.unit_axis("axis", vector)
    triad = np.array(checks.axis_triad(axis))
    np.testing.assert_allclose(
        triad @ triad.T, np.eye(3), atol=1e-14
    )  # a few roundings of numbers of size one
    assert np.linalg.det(triad) == pytest.approx(1.0, abs=1e-14)
    np.testing.assert_array_equal(triad[2], np.array(axis) + 0.0)


def test_a_sphere_has_no_axis():
    assert Rolling("ball", 0.1, axis=None).axis is None


def test_lengths_may_be_functions_of_time():
    grow = sinusoid(0.1, 1.0, offset=1.0)
    assert Distance("a", None, grow).length is grow
    assert Distance("a", "b").length is None


def test_stiction_is_coulomb_when_left_out():
    assert LuGre("j", 1e5, 300, 2).stiction == 2.0
    assert LuGre("j", 1e5, 300, 2, stiction=3).stiction == 3.0


def test_numbers_become_floats_and_arrays_are_copied():
    assert isinstance(JointFriction("j", mu=np.float32(0.5)).mu, float)
    assert isinstance(LuGre("j", 1, 0, 1, stiction=2).stiction, float)
    assert isinstance(SigmoidFriction("j", 1, 2).phi2, float)
    assert Wrench("a", np.arange(6)).value == (0.0, 1.0, 2.0, 3.0, 4.0, 5.0)
    values = np.ones((2, 3))
    table = Table([0.0, 1.0], values)
    values[:] = 5.0
    assert float(np.max(table.values)) == 1.0


NAN, INF = math.nan, math.inf
REFUSED = {
    # names
    "frame not a name": (lambda: PointAnchor(3), "PointAnchor: frame1 must be a name (a string); got 3"),
    "frame to itself": (
        lambda: FrameAnchor("a", "a", name="loop"),
        'FrameAnchor "loop": frame1 and frame2 must differ; both are "a"',
    ),
    "joint to itself": (
        lambda: JointCoupling("j", "j", 1.0),
        'JointCoupling: joint1 and joint2 must differ; both are "j"',
    ),
    "plane is the frame": (
        lambda: PointContact("foot", plane="foot"),
        'PointContact: frame and plane must differ; both are "foot"',
    ),
    # axes
    "axes misspelled": (
        lambda: PointAnchor("a", axes="xq"),
        "PointAnchor: axes must be one or more of the letters \"xyz\", each once; got 'xq'",
    ),
    "axes twice": (
        lambda: PointAnchor("a", axes="xx"),
        "PointAnchor: axes must be one or more of the letters \"xyz\", each once; got 'xx'",
    ),
    "axis misspelled": (
        lambda: HingeAnchor("a", axis="w"),
        'HingeAnchor: axis must be "x", "y", "z" or three numbers; got \'w\'',
    ),
    "axis of two numbers": (
        lambda: KnifeEdge("a", axis=[1, 0]),
        "KnifeEdge: axis must have shape (3,); got shape (2,)",
    ),
    "axis without direction": (
        lambda: Rolling("a", 0.5, normal=[0, 0, 0]),
        "Rolling: normal must have a direction; got three zeros",
    ),
    "axis with nan": (
        lambda: HingeAnchor("a", axis=[0, NAN, 1]),
        "HingeAnchor: axis must be finite; entry [1] is nan",
    ),
    # numbers
    "negative length": (lambda: Distance("a", "b", -1), "Distance: length must be positive; got -1"),
    "zero length": (lambda: Distance("a", "b", 0.0), "Distance: length must be positive; got 0"),
    "length to the world": (
        lambda: Distance("a"),
        "Distance: length must be given when frame2 is None (frame1 starts at distance zero from its own "
        "start); "
        "pass a length or a second frame",
    ),
    "ratio of zero": (
        lambda: JointCoupling("j", "k", 0.0),
        "JointCoupling: ratio must not be zero; hold a joint at rest by a PrescribedMotion, or lock it",
    ),
    "offset infinite": (
        lambda: JointCoupling("j", "k", 1.0, INF),
        "JointCoupling: offset must be finite; got inf",
    ),
    "radius of zero": (lambda: Rolling("a", 0), "Rolling: radius must be positive; got 0"),
    "negative friction": (
        lambda: JointFriction("j", mu=-0.1),
        "JointFriction: mu must not be negative; got -0.1",
    ),
    "negative contact friction": (
        lambda: PointContact("foot", mu=-1, name="toe"),
        'PointContact "toe": mu must not be negative; got -1',
    ),
    "static below kinetic": (
        lambda: JointFriction("j", mu=0.1, static_ratio=0.9),
        "JointFriction: static_ratio must be at least 1 (static friction is never below kinetic friction); "
        "got 0.9",
    ),
    "static below kinetic in a contact": (
        lambda: PointContact("foot", mu=0.1, static_ratio=0.5),
        "PointContact: static_ratio must be at least 1 (static friction is never below kinetic friction); "
        "got 0.5",
    ),
    "friction that does nothing": (
        lambda: JointFriction("j", radius=0.1),
        "JointFriction: one of coulomb, mu, preload, viscous must be positive; all are zero, "
        "so leave the law out",
    ),
    "span of zero": (
        lambda: JointFriction("j", mu=1, span=0),
        "JointFriction: span must be positive; got 0",
    ),
    "number as text": (
        lambda: JointFriction("j", mu="0.1"),
        "JointFriction: mu must be a number; got '0.1'",
    ),
    "truth as number": (
        lambda: JointFriction("j", mu=True),
        "JointFriction: mu must be a number; got True",
    ),
    "array as number": (
        lambda: Drag("a", np.ones(2)),
        "Drag: coefficient must be one number; got an array of shape (2,)",
    ),
    "negative swing": (
        lambda: SigmoidFriction("j", -0.5, 5.0, name="rub"),
        'SigmoidFriction "rub": phi1 must not be negative; got -0.5',
    ),
    "no steepness": (
        lambda: SigmoidFriction("j", 0.5, 0.0),
        "SigmoidFriction: phi2 must be positive; got 0",
    ),
    "offset of velocity nan": (
        lambda: SigmoidFriction("j", 0.5, 5.0, NAN),
        "SigmoidFriction: phi3 must be finite; got nan",
    ),
    "sigmoid of a joint by number": (
        lambda: SigmoidFriction(1, 0.5, 5.0),
        "SigmoidFriction: joint must be a name (a string); got 1",
    ),
    "bristles without stiffness": (
        lambda: LuGre("j", 0, 300, 1),
        "LuGre: stiffness must be positive; got 0",
    ),
    "bristles that drive": (
        lambda: LuGre("j", 1e5, -300, 1),
        "LuGre: damping must not be negative; got -300",
    ),
    "bristles without friction": (
        lambda: LuGre("j", 1e5, 300, 0),
        "LuGre: coulomb must be positive; got 0",
    ),
    "viscous part that drives": (
        lambda: LuGre("j", 1e5, 300, 1, viscous=-1),
        "LuGre: viscous must not be negative; got -1",
    ),
    "stribeck velocity of zero": (
        lambda: LuGre("j", 1e5, 300, 1, stribeck_velocity=0),
        "LuGre: stribeck_velocity must be positive; got 0",
    ),
    "stiction below coulomb": (
        lambda: LuGre("j", 1e5, 300, 2, stiction=1.5, name="rub"),
        'LuGre "rub": stiction must be at least coulomb (static friction is never below kinetic friction); '
        "got 1.5 and 2",
    ),
    "stiction of zero": (
        lambda: LuGre("j", 1e5, 300, 2, stiction=0),
        "LuGre: stiction must be positive; got 0",
    ),
    "unknown reaction": (
        lambda: JointFriction("j", mu=1, reaction="totl"),
        "JointFriction: reaction must be one of 'total', 'ideal'; got 'totl'; nearest: \"total\"",
    ),
    "states not whole": (
        lambda: UserLaw(nothing, states=1.5),
        "UserLaw: states must be an integer; got 1.5",
    ),
    "negative exponent": (lambda: Drag("a", 1, -1), "Drag: exponent must be positive; got -1"),
    "rows not positive": (
        lambda: UserConstraint(nothing, 0),
        "UserConstraint: size must be at least 1; got 0",
    ),
    "rows without end": (
        lambda: UserConstraint(nothing, 10**9),
        "UserConstraint: size must be at most 10000; got 1000000000",
    ),
    "spring without stiffness": (
        lambda: SpringDamper("a", "b"),
        "SpringDamper: stiffness or damping must be positive; both are zero, so leave the force out",
    ),
    "spring of one frame": (
        lambda: SpringDamper("a", "a", stiffness=1),
        'SpringDamper: frame1 and frame2 must differ; both are "a"',
    ),
    "joint spring without stiffness": (
        lambda: JointSpring("j", 0),
        "JointSpring: stiffness or damping must be positive; both are zero, so leave the force out",
    ),
    "rolling on itself": (
        lambda: Rolling("a", 0.1, plane="a"),
        'Rolling: frame and plane must differ; both are "a"',
    ),
    "bounce of a closed contact": (
        lambda: PointContact("a", restitution=0.5, unilateral=False),
        "PointContact: only a contact that may open has restitution; omit restitution or unilateral",
    ),
    "negative stiffness": (
        lambda: JointSpring("j", -1),
        "JointSpring: stiffness must not be negative; got -1",
    ),
    "wrench of three": (
        lambda: Wrench("a", [1, 2, 3]),
        "Wrench: value [force; moment] must have shape (6,); got shape (3,)",
    ),
    "negative period": (
        lambda: SampledControl(nothing, -0.1),
        "SampledControl: period must be positive; got -0.1",
    ),
    "gain negative": (
        lambda: HoldPosition([1, -2], 0),
        "HoldPosition: kp must not be negative; got -2",
    ),
    "gain nan": (lambda: HoldPosition(NAN, 0), "HoldPosition: kp must be finite; got nan"),
    "gain as text": (
        lambda: HoldPosition("3", 0),
        "HoldPosition: kp must be a number or an array of numbers; got '3'",
    ),
    "table not increasing": (
        lambda: Table([0, 2, 1], np.zeros((3, 1))),
        "Table: times must increase; times[2] = 1 does not follow times[1] = 2",
    ),
    "table of wrong height": (
        lambda: Table([0, 1], [[1.0]]),
        "Table: values must have shape (2, n); got shape (1, 1)",
    ),
    "table ragged": (
        lambda: Table([0, 1], [[1.0], [1.0, 2.0]]),
        "Table: values must be an array of numbers of shape (2, n); got [[1.0], [1.0, 2.0]]",
    ),
    "table with nan": (
        lambda: Table([0, 1], [[1.0], [NAN]]),
        "Table: values must be finite; entry [1, 0] is nan",
    ),
    "empty table": (lambda: Table([], []), "Table: times must hold at least one sample; got none"),
    # functions
    "motion without function": (
        lambda: PrescribedMotion("j", 3),
        "PrescribedMotion: function must be a function t -> (value, rate, acceleration); got 3",
    ),
    "law without function": (
        lambda: UserLaw(None),
        "UserLaw: function must be a function (t, q, v, reactions) -> C; got None",
    ),
    "law with states without function": (
        lambda: UserLaw(None, states=2),
        "UserLaw: function must be a function (t, q, v, reactions, z) -> (C, dz); got None",
    ),
    "constraint residual not a function": (
        lambda: UserConstraint(nothing, 1, residual=[0]),
        "UserConstraint: residual must be a function (t, q) -> phi; got [0]",
    ),
    "constraint rate not a function": (
        lambda: UserConstraint(nothing, 1, rate=1.0),
        "UserConstraint: rate must be a function (t, q, v) -> rate; got 1.0",
    ),
    "constraint without function": (
        lambda: UserConstraint("A", 1),
        "UserConstraint: function must be a function (t, q, v, data) -> (A, b); got 'A'",
    ),
    "friction without limit": (
        lambda: UserFriction(nothing, 0.5),
        "UserFriction: limit must be a function (t, q, v, reactions) -> force; got 0.5",
    ),
    "friction without direction": (
        lambda: UserFriction([1, 0], nothing),
        "UserFriction: direction must be a function (t, q) -> row; got [1, 0]",
    ),
    "force without function": (
        lambda: UserForce(1.0),
        "UserForce: function must be a function (t, q, v) -> force; got 1.0",
    ),
    "control without function": (
        lambda: SampledControl(1.0, 0.1),
        "SampledControl: function must be a function (t, q, v) -> tau; got 1.0",
    ),
}


@pytest.mark.parametrize(("make", "message"), REFUSED.values(), ids=REFUSED)
def test_refusals_say_what_must_hold(make, message):
    with pytest.raises(InputError, match="^" + re.escape(message) + "$"):
        make()
