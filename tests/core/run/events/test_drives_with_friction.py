"""Joints with dry friction that prescribed motions move from rest, beside the motion without friction."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ....scene.test_symmetries import check
from ....support.loops import started_loop
from ....support.mechanisms import body, empty, frame
from ....support.random_trees import tree
from ....support.same_run import assert_same_run
from ....support.seeds import ranges

COULOMB = 0.7
DURATION = 2.0
METHODS: list[dict[str, Any]] = [
    {"rtol": 1e-9},
    {"method": "dopri5", "rtol": 1e-9},
    {"method": "rk4", "dt": 1e-3},
    {"method": "semi_implicit_euler", "dt": 1e-3},
    {"method": "moreau", "dt": 1e-3},
]


def minimum_jerk(t: float) -> tuple[float, float, float]:
    """0.3 between 0.5 s and 1.5 s, from rest to rest, with a known second derivative."""
    s = min(max(t - 0.5, 0.0), 1.0)
    return (
        0.3 * s**3 * (10.0 - 15.0 * s + 6.0 * s**2),
        0.3 * 30.0 * s**2 * (1.0 - s) ** 2,
        0.3 * 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s),
    )


MOTIONS: dict[str, Callable[[], Any]] = {
    "spline from rest to rest": lambda: pn.spline([0.5, 1.5], [0.0, 0.3]),
    "cubic": lambda: pn.polynomial([0.0, 0.0, 0.0, 0.2]),
    "quartic, backward": lambda: pn.polynomial([0.0, 0.0, 0.0, 0.0, -0.1]),
    "minimum jerk": lambda: minimum_jerk,
}


def carriage() -> tuple[pin.Model, int]:
    """Return a carriage on a rail with a pendulum."""
    model = empty()
    joint = body(model, 0, pin.JointModelPX(), "carriage", 2.0)
    body(model, joint, pin.JointModelRY(), "pendulum", 1.0, lever=(0.0, 0.0, -0.5), inertia=0.01 * np.eye(3))
    return model, joint


@pytest.mark.parametrize("options", METHODS, ids=lambda options: options.get("method", "dop853"))
@pytest.mark.parametrize("motion", MOTIONS)
def test_a_carriage_with_friction_starts(motion: str, options: dict[str, Any]) -> None:
    model, _ = carriage()
    drive = pn.PrescribedMotion("carriage", MOTIONS[motion](), name="drive")
    free = pn.Scene(model, constraints=[drive], q0=[0.0, 0.3])
    rough = free.replace(laws=[pn.JointFriction("carriage", coulomb=COULOMB)])
    options = {**options, "output_dt": 0.05, "record": ("a", "forces")}
    one, other = (pn.simulate(scene, DURATION, **options) for scene in (free, rough))
    accuracy = 1e-7 if "rtol" in options else 1e-2
    q, other_q, v, force, other_force = (
        run_values[run.grid]
        for run_values, run in (
            (one.q, one),
            (other.q, other),
            (one.v, one),
            (one.lam[:, 0], one),
            (other.lam[:, 0], other),
        )
    )
    np.testing.assert_allclose(other_q, q, atol=accuracy)
    # Friction changes only the force of the drive.
    moving = np.abs(v[:, 0]) > 1e-3
    expected = COULOMB * np.sign(v[:, 0])
    np.testing.assert_allclose(
        (other_force - force)[moving], expected[moving], atol=max(1e-5, 100.0 * accuracy)
    )
    if "rtol" in options:
        assert [e.kind for e in other.events if e.kind in ("stick", "slip")][:1] == ["slip"]


def trapezoid(t: float, start: float) -> tuple[float, float, float]:
    """0.1875 m forward from `start` within a second: the acceleration of 1 m/s^2 jumps four times."""
    s = t - start
    if s < 0.0 or s >= 1.0:
        return (0.0 if s < 0.0 else 0.1875), 0.0, 0.0
    if s < 0.25:
        return 0.5 * s**2, s, 1.0
    if s < 0.75:
        return 0.03125 + 0.25 * (s - 0.25), 0.25, 0.0
    return 0.1875 - 0.5 * (1.0 - s) ** 2, 1.0 - s, -1.0


STOPS: dict[str, tuple[Callable[[], Any], list[float]]] = {
    "there and back": (
        lambda: pn.spline([0.5, 1.0, 1.3, 1.7], [0.0, 0.3, 0.3, 0.0]),
        [0.5, 1.7],
    ),
    "spline": (lambda: pn.spline([0.5, 1.5], [0.0, 0.3]), [0.5, 1.5]),
    "minimum jerk": (lambda: minimum_jerk, [0.5, 1.5]),
    "trapezoid": (lambda: lambda t: trapezoid(t, 0.5), [0.5, 1.5]),
    "trapezoid between steps": (lambda: lambda t: trapezoid(t, 0.4503), [0.4503, 1.4503]),
}


@pytest.mark.parametrize("options", METHODS, ids=lambda options: options.get("method", "dop853"))
@pytest.mark.parametrize("motion", STOPS)
def test_a_carriage_that_its_drive_stops_rests(motion: str, options: dict[str, Any]) -> None:
    """At rest the drive carries the load without the friction, which neither holds nor pushes."""
    model, _ = carriage()
    make, (start, stop) = STOPS[motion]
    drive = pn.PrescribedMotion("carriage", make(), name="drive")
    free = pn.Scene(model, constraints=[drive], q0=[0.0, 0.3])
    rough = free.replace(laws=[pn.JointFriction("carriage", coulomb=COULOMB)])
    options = {**options, "output_dt": 0.05, "record": "forces"}
    expected, run = (pn.simulate(scene, DURATION, **options) for scene in (free, rough))
    at_rest = (run.t[run.grid] < start - 0.01) | (run.t[run.grid] > stop + 0.01)
    force, expected_force = run.lam[run.grid][at_rest], expected.lam[expected.grid][at_rest]
    np.testing.assert_allclose(force, expected_force, atol=1e-7 if "rtol" in options else 1e-2)
    kinds = [e for e in run.events if e.kind in ("stick", "slip")]
    assert (kinds[0].kind, kinds[-1].kind) == ("slip", "stick")
    assert kinds[0].time == pytest.approx(start, abs=2e-3)
    assert kinds[-1].time == pytest.approx(stop, abs=2e-3)


def test_a_drive_starts_the_same_way_in_each_run() -> None:
    model, _ = carriage()
    drive = pn.PrescribedMotion("carriage", pn.polynomial([0.0, 0.0, 0.0, 0.2]), name="drive")
    scene = pn.Scene(model, constraints=[drive], laws=[pn.JointFriction("carriage", coulomb=COULOMB)])
    first = pn.simulate(scene, 0.5)
    for earlier in (0.5, 1e-7, 3e-6):
        pn.simulate(scene, earlier)
        assert_same_run(first, pn.simulate(scene, 0.5))


@pytest.mark.parametrize("limit", [0.0, 1.0, 20.0])
def test_a_drive_at_rest_carries_the_weight(limit: float) -> None:
    """The friction of a joint at rest takes no load from the drive that holds it."""
    model = empty()
    body(model, 0, pin.JointModelPZ(), "lift", 1.0)
    hold = pn.PrescribedMotion("lift", pn.constant(0.0), name="drive")
    law = pn.UserFriction(lambda t, q: np.array([1.0]), lambda t, q, v, r: limit)
    for laws in ([law], [pn.JointFriction("lift", coulomb=limit, viscous=1.0)]):
        scene = pn.Scene(model, constraints=[hold], laws=laws)
        at_rest = scene.solve(np.zeros(1), np.zeros(1))
        assert at_rest.lam == pytest.approx([9.81], rel=1e-9)
        assert at_rest.F_nonideal == pytest.approx([0.0], abs=1e-8)
        run = pn.simulate(scene, 0.1, record="forces")
        assert run.lam[-1] == pytest.approx([9.81], rel=1e-9)


@pytest.mark.parametrize("many", ranges(3, 30, 300))
def test_a_drive_at_rest_holds_a_loop_as_without_friction(many: range) -> None:
    for seed in many:
        free, rough = (started_loop(seed, rough) for rough in (False, True))
        q, v = free.q0, np.zeros(free.model.nv)
        drive = free.constraint_slices["drive"]
        holding = free.solve(q, v, 0.0).lam[drive]
        assert rough.solve(q, v, 0.0).lam[drive] == pytest.approx(holding, rel=1e-8), seed


@pytest.mark.parametrize("many", ranges(2, 20, 300))
def test_a_loop_with_friction_in_its_hinges_starts(many: range) -> None:
    for seed in many:
        free, rough = (started_loop(seed, rough) for rough in (False, True))
        exact = pn.simulate(free, 0.5 * DURATION, rtol=1e-10)
        for options in METHODS:
            run = pn.simulate(rough, 0.5 * DURATION, **options)
            assert np.abs(run.q[-1] - exact.q[-1]).max() < 1e-8, (seed, options)
            assert np.abs(run.v[-1] - exact.v[-1]).max() < 1e-7, (seed, options)


@pytest.mark.parametrize("many", ranges(2, 20, 300))
def test_a_loop_that_its_drive_stops_rests(many: range) -> None:
    for seed in many:
        free, rough = (started_loop(seed, rough, stop=0.5) for rough in (False, True))
        exact = pn.simulate(free, 0.7, rtol=1e-10, record="forces")
        for options in METHODS:
            run = pn.simulate(rough, 0.7, record="forces", **options)
            assert np.abs(run.q[-1] - exact.q[-1]).max() < 1e-8, (seed, options)
            assert run.lam[-1] == pytest.approx(exact.lam[-1], rel=1e-6, abs=1e-6), (seed, options)
            of_crank = [e for e in run.events if e.element == "JointFriction(crank)"]
            assert [e.kind for e in of_crank if e.kind != "reverse"] == ["slip", "stick"], (seed, options)


@pytest.mark.parametrize("options", METHODS, ids=lambda options: options.get("method", "dop853"))
def test_drives_that_contradict_each_other_are_an_error_beside_friction(options: dict[str, Any]) -> None:
    """Friction that sticks elsewhere is not the cause."""
    model, _ = carriage()
    drives = [
        pn.PrescribedMotion("carriage", pn.spline([0.1, 1.0], [0.0, 0.3]), name="drive"),
        pn.UserConstraint(lambda t, q, v, data: (np.array([[1.0, 0.0]]), np.zeros(1)), 1, name="still"),
    ]
    for laws in ([], [pn.JointFriction("pendulum", coulomb=10.0)]):
        scene = pn.Scene(model, constraints=drives, laws=laws, q0=[0.0, 0.3])
        with pytest.raises(pn.InconsistentConstraintsError, match=r'"still" and "drive"|"drive" and "still"'):
            pn.simulate(scene, 0.8, **options)


def test_methods_of_scipy_name_the_friction_that_a_drive_would_move() -> None:
    model, _ = carriage()
    drive = pn.PrescribedMotion("carriage", pn.polynomial([0.0, 0.0, 0.0, 0.2]), name="drive")
    scene = pn.Scene(model, constraints=[drive], laws=[pn.JointFriction("carriage", coulomb=COULOMB)])
    with pytest.raises(pn.InconsistentConstraintsError, match='"dop853", in which the friction slips'):
        pn.simulate(scene, 1.0, method="Radau")


@pytest.mark.parametrize(
    "contacts", [[], [pn.PointContact("hand", height=-100.0, mu=0.5)]], ids=["", "contact"]
)
def test_a_held_joint_with_friction_neither_slips_nor_takes_load_in_time_steps(contacts: list[Any]) -> None:
    """The other joints move, and rounding of the velocity at the held joint has no sign."""
    model = tree(
        ["revolute x", "revolute unaligned", "prismatic y"], np.random.default_rng(5), parents=range(3)
    )
    frame(model, "hand", 3)
    hold = pn.PrescribedMotion("j0", pn.constant(0.3), name="drive")
    free = pn.Scene(model, constraints=[hold], contacts=contacts, q0=[0.3, -0.4, 0.1], v0=[0.0, -0.7, 0.3])
    rough = free.replace(laws=[pn.JointFriction("j0", coulomb=0.5, static_ratio=1.2)])
    expected, run = (pn.simulate(s, 0.25, method="moreau", dt=1e-3, record="forces") for s in (free, rough))
    assert [e.kind for e in run.events] == []
    np.testing.assert_allclose(run.q, expected.q, atol=1e-12)
    np.testing.assert_allclose(run.lam[1:], expected.lam[1:], rtol=1e-9)


@pytest.mark.parametrize(
    ("name", "transformation", "function"),
    [
        ("started loop 1", "tonnes, kilometers, hours", "solve"),
        ("started with friction held", "rows by hand, times 1e-4", "solve"),
        ("started loop 2", "a far contact", "simulate rk4"),
        ("started loop 0", "rk4", "simulate dop853"),
    ],
)
def test_images_answer_as_their_scenes(name: str, transformation: str, function: str) -> None:
    check(name, transformation, [function])


def test_a_drive_elsewhere_changes_no_loads_at_rest() -> None:
    """Joints that friction holds share loads with a loop alike, with and without a driven cart."""
    loop = pn.load("rough_four_bar")
    model = loop.model.copy()
    cart = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "cart")
    model.appendBodyToJoint(cart, pin.Inertia(1.0, np.zeros(3), 0.01 * np.eye(3)), pin.SE3.Identity())
    parts = {"constraints": loop.constraints, "laws": loop.laws}
    q0 = np.append(loop.q0, 0.0)
    alone = pn.Scene(model, q0=q0, **parts)
    drive = pn.PrescribedMotion("cart", pn.sinusoid(0.1, 1.0), name="drive")
    beside = pn.Scene(model, q0=q0, **parts | {"constraints": [*loop.constraints, drive]})
    assert pn.rest(beside).margin == pytest.approx(pn.rest(alone).margin, rel=1e-9)
    q, v = beside.project()
    stuck = [0] * len(loop.element_names)
    one, other = (scene.solve(q, v, modes=stuck) for scene in (alone, beside))
    rows = len(one.lam)
    np.testing.assert_allclose(other.lam[:rows], one.lam, atol=1e-9)
