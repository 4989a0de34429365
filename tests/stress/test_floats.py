"""Numbers at the ends of the range of floats: calls return finite numbers or raise a named error."""

from __future__ import annotations

import itertools
import warnings

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.errors import NonFiniteError, PinNonidealError

from ..support.mechanisms import body, empty
from .measure import finite

FEW = ["rolling_disk", "belt_oscillator", "loaded_joint"]
MANY = ["four_bar", "five_bar", "knife_edge_sleigh", "slider_crank", "worm_drive", "delta"]
ORDINARY = 1e10  # numbers no larger are taken by every call
EDGES = [5e-324, -5e-324, 2.2e-308, 1e-200, -0.0, 1e20, 1e100, -1e154, 1e200, 1e300, -1.7e308]
TINY = EDGES[1:5]  # the disk's search takes as long for each of these as for the first edge


@pytest.fixture(autouse=True)
def no_warnings():
    """Overflow is reported by name, not as a warning of NumPy."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message="simulate: the initial (configuration|velocity)")
        yield


def ends_well(call, size):
    """Return the result of a call with numbers of this size, or None after a named error."""
    try:
        result = call()
    except PinNonidealError as error:
        print(f"{type(error).__name__}: {error}")
        assert abs(size) > ORDINARY
        trajectory = getattr(error, "trajectory", None)
        if trajectory is not None:
            finite(trajectory)
        return None
    if isinstance(result, pn.Trajectory):
        finite(result)
    else:
        assert np.isfinite(result).all()
    return result


def robot_at(robot, edge):
    stress, slow = robot in MANY, robot == "rolling_disk" and edge in TINY
    return pytest.param(robot, edge, marks=[pytest.mark.stress] * stress + [pytest.mark.slow] * slow)


@pytest.mark.parametrize(
    ("robot", "edge"), [robot_at(*both) for both in itertools.product([*FEW, *MANY], EDGES)]
)
def test_states_and_torques(robot, edge):
    scene = pn.load(robot)
    q, v = scene.initial_state()
    fast = np.full_like(v, edge)
    ends_well(lambda: scene.acceleration(q, fast), edge)
    ends_well(lambda: scene.acceleration(q, v, tau=fast), edge)
    ends_well(lambda: scene.solve(q, v, tau=fast).F_nonideal, edge)
    duration = 1e-3 / max(1.0, abs(edge))  # a run of some steps at any speed
    ends_well(lambda: pn.simulate(scene, duration, v=fast), edge)
    moved = q.copy()
    numbers = [j for j in list(scene.model.joints)[1:] if j.nq == j.nv]  # no part of a rotation
    for k in (k for j in numbers for k in range(j.idx_q, j.idx_q + j.nq)):
        moved[k] = edge
        ends_well(lambda: pn.simulate(scene, 1e-3, q=moved), edge)
        moved[k] = q[k]


def test_negative_zero_is_zero():
    """-0.0 in a state and in a torque change no bit of the motion but its sign of zero."""
    scene = pn.load("belt_oscillator")
    v = scene.initial_state()[1]
    plain, other = pn.simulate(scene, 0.5, v=0.0 * v), pn.simulate(scene, 0.5, v=-0.0 * v)
    assert (plain.q == other.q).all()
    assert (plain.v == other.v).all()
    assert plain.events == other.events


@pytest.mark.parametrize("scale", [5e-324, 1e-310, 1e-200, 1e-100, 1e-30, 1e30, 1e100, 1e150, 1e300])
def test_bodies_of_any_mass(scale):
    """The motion of a double pendulum does not depend on its mass; an error reports overflow of M."""
    model = empty()
    for k, place in enumerate((pin.SE3.Identity(), pin.SE3(np.eye(3), np.array([1.0, 0.0, 0.0])))):
        about = 0.1 * scale * np.eye(3)
        body(model, k, pin.JointModelRY(), f"j{k}", scale, place=place, lever=(0.5, 0.0, 0.0), inertia=about)
    run = ends_well(lambda: pn.simulate(pn.Scene(model), 0.5, output_dt=0.1), np.inf)
    assert run is not None or not 1e-100 <= scale <= 1e100


@pytest.mark.parametrize("coulomb", [5e-324, 1e-200, 1e200, 1.7e308])
@pytest.mark.parametrize("stiffness", [0.0, 1e-300, 1e200])
def test_laws_and_forces_of_any_size(coulomb, stiffness):
    model = empty()
    body(model, 0, pin.JointModelRY(), "j", 1.0, lever=(0.5, 0.0, 0.0))
    scene = pn.Scene(
        model,
        laws=[pn.JointFriction("j", coulomb=coulomb, mu=0.1, radius=0.01, viscous=min(coulomb, 1e3))],
        forces=[pn.JointSpring("j", stiffness, rest=0.1)] if stiffness else [],
    )
    for method, options in (("dop853", {}), ("rk4", {"dt": 1e-3}), ("moreau", {"dt": 1e-3})):
        ends_well(
            lambda method=method, options=options: pn.simulate(scene, 0.01, method=method, **options),
            max(coulomb, stiffness),
        )


@pytest.mark.parametrize("call", ["solve", "project"])
@pytest.mark.parametrize("edge", EDGES)
def test_plain_arrays(call, edge):
    """Eq. (40) on arrays, and projection, at the ends of the range."""
    M, F, A = np.eye(2), np.array([edge, 1.0]), np.array([[1.0, 1.0]])
    least = max(abs(edge), 5e-324)  # dividing by it may overflow
    if call == "solve":
        ends_well(lambda: pn.solve(M, F, A, np.array([0.0])).a, edge)
        ends_well(lambda: pn.solve(M, np.ones(2), A * edge, np.array([1.0])).a, max(least, 1 / least))
        ends_well(lambda: pn.solve(M * least, F, A, np.array([0.0])).a, max(least, 1 / least))
    else:
        scene = pn.load("slider_crank")
        q, v = scene.initial_state()
        ends_well(lambda: np.concatenate(scene.project(q + edge, v)), edge)
        ends_well(lambda: np.concatenate(scene.project(q, v + edge)), edge)


def test_a_load_that_overflows_is_no_paradox():
    scene = pn.load("four_bar")
    with pytest.raises(NonFiniteError, match="acceleration is not finite at t = 0 s"):
        scene.acceleration(*scene.initial_state(), tau=np.full(3, 1e154))
