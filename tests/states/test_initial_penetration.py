"""Starts with contacts inside their planes, moved out by the least distance, beside SciPy's SLSQP."""

from __future__ import annotations

import warnings

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from oracles.nearest_closure import distance, nearest_outside

from ..support.mechanisms import body, empty, frame, point_mass
from ..support.seeds import seeds

# By which a distance may be longer than the optimizer's, and the part of the depth by which that may miss.
SAME_DISTANCE, MISSED = 1e-6, 1e-8
# By which a contact may be inside after it was moved out [m].
INSIDE = 1e-12


class Legged:
    """A random body on legs with points or soles, some below the ground, two of them tied together."""

    def __init__(self, seed: int) -> None:
        self.rng = rng = np.random.default_rng(seed)
        self.model = model = empty()
        floats = rng.uniform() < 0.7
        root = pin.JointModelFreeFlyer() if floats else pin.JointModelPZ()
        base = body(
            model, 0, root, "base", rng.uniform(3.0, 10.0), inertia=np.diag(rng.uniform(0.05, 0.3, 3))
        )
        self.feet: list[str] = []
        legs = int(rng.integers(1, 5))
        for leg in range(legs):
            self.leg(leg, base)
        self.data = model.createData()
        straight = rng.uniform() < 0.3
        bend = np.zeros(model.nv)
        if not straight:
            bend[6 if floats else 1 :] = rng.uniform(-0.5, 0.5, model.nv - (6 if floats else 1))
            turn = 0.1 * rng.standard_normal(3)
            if floats:
                bend[3:6] = turn
        q = pin.integrate(model, pin.neutral(model), bend)
        self.apart, rods = 0.0, []
        if legs > 1 and rng.uniform() < 0.4:
            self.apart = self.between(q) * (1.0 + 1e-3 * rng.standard_normal())
            rods = [pn.Distance("tip0", "tip1", length=self.apart, name="rod")]
        self.depth = float(rng.choice([1e-4, 1e-3, 4e-3, 8e-3]))
        q[2 if floats else 0] -= self.gaps(q).min() + self.depth
        said = [*self.feet, *(self.feet[:3] if rng.uniform() < 0.3 else [])]  # some of them twice
        contacts = [pn.PointContact(foot, mu=0.5, name=f"{foot} {k}") for k, foot in enumerate(said)]
        self.scene, self.q = pn.Scene(model, constraints=rods, contacts=contacts), q

    def leg(self, leg: int, joint: int) -> None:
        rng, place = self.rng, np.array([*self.rng.uniform(-0.3, 0.3, 2), -0.05])
        for k in range(int(rng.integers(2, 5))):
            axis = rng.standard_normal(3) if rng.uniform() < 0.4 else np.array([0.0, 1.0, 0.0])
            joint = body(
                self.model,
                joint,
                pin.JointModelRevoluteUnaligned(axis / np.linalg.norm(axis)),
                f"leg{leg} {k}",
                rng.uniform(0.2, 1.0),
                place=pin.SE3(np.eye(3), place),
                lever=rng.uniform(-0.05, 0.05, 3),
                inertia=np.diag(rng.uniform(0.001, 0.01, 3)),
            )
            place = np.array([*(rng.uniform(-0.05, 0.05, 2)), -rng.uniform(0.25, 0.4)])
        sole = [(0.0, 0.0)] if rng.uniform() < 0.4 else [(x, y) for x in (-0.08, 0.1) for y in (-0.05, 0.05)]
        for k, (x, y) in enumerate(sole):
            self.feet.append(f"foot{leg} {k}")
            frame(self.model, self.feet[-1], joint, pin.SE3(np.eye(3), place + np.array([x, y, 0.0])))
        frame(self.model, f"tip{leg}", joint, pin.SE3(np.eye(3), place))

    def place(self, q: np.ndarray, name: str) -> np.ndarray:
        return np.array(self.data.oMf[self.model.getFrameId(name)].translation)

    def gaps(self, q: np.ndarray) -> np.ndarray:
        pin.framesForwardKinematics(self.model, self.data, q)
        return np.array([self.place(q, foot)[2] for foot in self.feet])

    def between(self, q: np.ndarray) -> float:
        pin.framesForwardKinematics(self.model, self.data, q)
        return float(np.linalg.norm(self.place(q, "tip0") - self.place(q, "tip1")))

    def rod(self, q: np.ndarray) -> np.ndarray:
        return np.array([self.between(q) - self.apart]) if self.apart else np.zeros(0)


def check(seed: int) -> None:
    robot = Legged(seed)
    on, v, report = robot.scene.project(robot.q, np.zeros(robot.model.nv), report=True)
    assert robot.gaps(on).min() >= -INSIDE
    assert np.abs(robot.rod(on)).max(initial=0.0) < INSIDE
    assert report.nearest
    assert report.distance == pytest.approx(distance(robot.model, robot.q, on), rel=1e-9)
    least, missed = nearest_outside(robot.model, robot.q, robot.rod, robot.gaps, robot.depth)
    if missed < MISSED:
        assert report.distance <= least * (1.0 + SAME_DISTANCE)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # that the start was moved
        run = pn.simulate(robot.scene, 1e-6, q=robot.q, v=v)
    np.testing.assert_array_equal(run.q[0], on)


@pytest.mark.parametrize("seed", seeds([0, *range(2, 14)]))
def test_soles_come_out_by_the_least_distance(seed: int) -> None:
    check(seed)


@pytest.mark.stress
def test_many_soles_come_out_by_the_least_distance() -> None:
    failed = []
    for seed in range(100, 500):
        try:
            check(seed)
        except (AssertionError, pn.PinNonidealError) as error:
            failed.append((seed, str(error)[:200]))
    assert not failed


def hanging(links: int, depth: float, feet=(-0.1, 0.1)) -> tuple[pn.Scene, np.ndarray]:
    """A straight leg that hangs from a fixed hip, its sole inside a plane: nothing moves it out at once."""
    model, joint, place = empty(), 0, np.array([0.0, 0.0, 0.8])
    for k in range(links):
        joint = body(
            model,
            joint,
            pin.JointModelRY(),
            f"j{k}",
            1.0,
            place=pin.SE3(np.eye(3), place),
            lever=np.array([0.0, 0.0, -0.2]),
            inertia=0.01 * np.eye(3),
        )
        place = np.array([0.0, 0.0, -0.4])
    for k, x in enumerate(feet):
        frame(model, f"c{k}", joint, pin.SE3(np.eye(3), np.array([x, 0.0, -0.05])))
    low = 0.8 - 0.4 * (links - 1) - 0.05
    frame(model, "ground", 0, pin.SE3(np.eye(3), np.array([0.0, 0.0, low + depth])))
    contacts = [pn.PointContact(f"c{k}", plane="ground", name=f"c{k}") for k in range(len(feet))]
    return pn.Scene(model, contacts=contacts), pin.neutral(model)


@pytest.mark.parametrize("depth", [1e-9, 1e-6, 1e-3, 3.5e-3])
def test_a_straight_leg_bends_its_knee(depth: float) -> None:
    """The knee bends by the root of the depth, 2 z'' = depth, although the linear model is singular."""
    scene, q = hanging(3, depth)
    on, _, report = scene.project(q, np.zeros(3), report=True)
    data = scene.model.createData()
    pin.framesForwardKinematics(scene.model, data, on)
    heights = [data.oMf[scene.model.getFrameId(name)].translation[2] for name in ("c0", "c1")]
    assert min(heights) >= -0.05 + depth - INSIDE
    assert report.nearest
    assert np.abs(on).max() < 4.0 * np.sqrt(depth)  # the legs' own lengths: cos(x) = 1 - x^2/2
    # The sole stays level; two links rise by this.
    assert 0.4 * (2.0 - np.cos(on[0]) - np.cos(on[0] + on[1])) == pytest.approx(depth, abs=1e-12)


def test_contacts_of_different_depths_on_one_slide() -> None:
    """The deepest is moved onto its plane; the other two come off theirs."""
    model = empty()
    joint = body(model, 0, pin.JointModelPZ(), "slide", 1.0)
    for k, below in enumerate((1e-3, 3e-3, 2e-3)):
        frame(model, f"c{k}", joint, pin.SE3(np.eye(3), np.array([0.4 * k, 0.0, -below])))
    scene = pn.Scene(model, contacts=[pn.PointContact(f"c{k}") for k in range(3)])
    on, _, report = scene.project([0.0], [0.0], report=True)
    assert on == pytest.approx([3e-3], abs=1e-15)
    assert report.nearest
    many = pn.rollout(scene, np.array([[0.0], [1e-3], [5e-3]]), np.zeros((3, 1)), 1e-6)
    assert [run.q[0, 0] for run in many] == pytest.approx([3e-3, 3e-3, 5e-3], abs=1e-15)


def test_an_open_contact_is_not_pushed_in() -> None:
    """A seesaw with one end inside by a rounded pose: its other end, a tenth of that above, stays outside."""
    model = empty()
    joint = body(model, 0, pin.JointModelFreeFlyer(), "seesaw", 1.0, inertia=1e-4 * np.eye(3))
    for k, (x, z) in enumerate([(-0.5, -1e-5), (0.5, 1e-6)]):
        frame(model, f"c{k}", joint, pin.SE3(np.eye(3), np.array([x, 0.0, z])))
    scene = pn.Scene(model, contacts=[pn.PointContact(f"c{k}") for k in range(2)])
    on, _, report = scene.project(pin.neutral(model), np.zeros(6), report=True)
    data = model.createData()
    pin.framesForwardKinematics(model, data, on)
    heights = [data.oMf[model.getFrameId(f"c{k}")].translation[2] for k in range(2)]
    assert min(heights) >= -INSIDE
    assert report.nearest


def test_what_finds_no_way_out_is_named() -> None:
    """A point between a floor and a ceiling that leave it no room."""
    model = point_mass("Z")
    frame(model, "far", 0, pin.SE3(np.eye(3), np.array([0.0, 0.0, 1.0])))
    frame(model, "ceiling", 0, pin.SE3(pin.rpy.rpyToMatrix(np.pi, 0.0, 0.0), np.array([0.0, 0.0, -1e-3])))
    above = pn.PointContact("mass", plane="ceiling", name="ceiling")
    scene = pn.Scene(model, contacts=[pn.PointContact("mass", name="floor"), above])
    with pytest.raises(pn.InputError) as error:
        scene.project([-2e-3], [0.0])
    assert (
        'contact "floor" starts with a penetration of 0.002 (m or rad) at t = 0 s, and no short move that '
        "removes it was found: change the start"
    ) in str(error.value)


@pytest.mark.parametrize("depth", [0.0, 7e-18, 1e-12, 1e-7, 1e-4])
@pytest.mark.parametrize(("radius", "inertia"), [(0.02, 2e-4), (0.4, 0.06), (0.1, 0.0)])
def test_a_body_at_the_origin_is_moved_out_of_a_plane(radius: float, inertia: float, depth: float) -> None:
    """Neither joints nor coordinates define a length of this scene, and its residual is the depth."""
    model = empty()
    root = pin.JointModelFreeFlyer() if inertia else pin.JointModelPZ()
    joint = body(model, 0, root, "ball", 1.0, inertia=inertia * np.eye(3))
    height = model.joints[joint].idx_q + 2 * (model.nq > 1)
    plane = pn.PointContact("ball", radius=radius, height=np.nextafter(depth - radius, 1.0))
    run = pn.simulate(pn.Scene(model, contacts=[plane]), 0.01)
    assert run.q[0, height] == pytest.approx(depth, abs=INSIDE)
    assert np.abs(run.q - run.q[0]).max() <= INSIDE
