"""States that do not fit a scene: each gives a named error, in these words."""

from __future__ import annotations

import numpy as np
import pytest

import pin_nonideal as pn
from pin_nonideal.errors import InputError, NonFiniteError, UnknownNameError

from ..support.every_joint import INF, MODEL, NAN, Q, V, scaled, with_entry
from ..support.refusals import refuses


@pytest.mark.parametrize(
    ("q", "what"),
    [
        (scaled(2, 4, 1.1), 'the quaternion of joint "j2" must have length 1; got 1.1; normalize it'),
        (scaled(6, 2, 0.9), 'the (cos, sin) pair of joint "j3" must have length 1; got 0.9; normalize it'),
        (scaled(11, 4, 0.0), 'the quaternion of joint "j4" must have length 1; got 0; normalize it'),
        (scaled(11, 4, 1e300), 'the quaternion of joint "j4" must have length 1; got 1e+300; normalize it'),
    ],
)
def test_configurations_far_from_unit_length(q, what):
    scene = pn.Scene(MODEL)
    for call in (scene.solve, scene.acceleration, scene.project, lambda q, v: pn.simulate(scene, 0.1, q, v)):
        with refuses(f"q: {what}", InputError):
            call(q, V)
    with refuses(f"q0: {what}", InputError):
        pn.Scene(MODEL, q0=q)


def test_times_that_are_none_are_refused_for_the_initial_state_as_well():
    with refuses("t must be one number; got an array of shape (0,)", InputError):
        pn.Scene(MODEL).project(t=np.array([]))


def test_coordinates_that_cannot_move_are_refused_where_motion_is_asked_for():
    scene, q = pn.Scene(MODEL), with_entry(Q, 0, 1e16)
    message = (
        f'q: joint "{MODEL.names[1]}" must start where floating-point numbers are at most 0.001 (m or rad) '
        "apart; at 1e+16 they are 2 apart; leave out whole turns, or move the origin"
    )
    calls = (
        lambda: scene.project(q, V),
        lambda: pn.simulate(scene, 0.1, q, V),
        lambda: pn.rollout(scene, q[None], V[None], 0.1),
        lambda: pn.Scene(MODEL, q0=q).initial_state(),
    )
    for call in calls:
        with refuses(message, InputError):
            call()
    assert np.isfinite(scene.acceleration(q, V)).all()
    scene.project(with_entry(Q, 0, 1e12), V)


def test_configurations_close_to_unit_length_are_normalized():
    scene = pn.Scene(MODEL)
    q = scaled(2, 4, 1.0 + 3e-7)
    np.testing.assert_allclose(scene.acceleration(q, V), scene.acceleration(Q, V), rtol=1e-12)
    assert np.linalg.norm(pn.simulate(scene, 0.01, q, V).q[0, 2:6]) == pytest.approx(1.0, abs=2e-16)


STATES = {
    "q shape": ({"q": Q[:3]}, "q must have shape (15,); got shape (3,)"),
    "q matrix": ({"q": Q[None]}, "q must have shape (15,); got shape (1, 15)"),
    "q word": ({"q": "home"}, 'q: no reference configuration "home"; there is none'),
    "v word": ({"v": "fast"}, "v must be an array of numbers of shape (12,); got 'fast'"),
    "q joint": ({"q": {"j00": 1.0}}, 'q: no joint "j00"; nearest: "j0"'),
    "v joint": ({"v": {3: 1.0}}, 'v: no joint "3"'),
    "q of a joint": ({"q": {"j0": [1.0, 2.0]}}, 'q of "j0" must have shape (1,); got shape (2,)'),
    "q of a joint nan": ({"q": {"j2": [0, 0, 0, NAN]}}, 'q of "j2" must be finite; entry [3] is nan'),
    "q piece": (
        {"q": {"j4": {"rpi": [0, 0, 0]}}},
        'q of "j4": no "rpi" in a FreeFlyer joint; nearest: "rpy"',
    ),
    "v piece": ({"v": {"j0": {"linear": 1}}}, 'v of "j0": no "linear" in a RX joint; there is none'),
    "q piece shape": ({"q": {"j4": {"xyz": 1.0}}}, 'q of "j4": xyz must have shape (3,); got shape ()'),
    "q turned twice": (
        {"q": {"j2": {"rpy": [0, 0, 1], "quaternion": [0, 0, 0, 1]}}},
        'q of "j2": give "rpy" or "quaternion", not both',
    ),
    "q short quaternion": (
        {"q": {"j2": {"quaternion": [0, 0, 0, 2]}}},
        'q: quaternion [x, y, z, w] of joint "j2" must have length 1; got 2',
    ),
    "q nan": ({"q": with_entry(Q, 0, NAN)}, "q must be finite; entry [0] is nan"),
    "v shape": ({"v": V[:3]}, "v must have shape (12,); got shape (3,)"),
    "v inf": ({"v": with_entry(V, 5, -INF)}, "v must be finite; entry [5] is -inf"),
    "t nan": ({"t": NAN}, "t must be finite; got nan"),
    "t word": ({"t": "now"}, "t must be a number; got 'now'"),
    "tau shape": ({"tau": [1.0]}, "tau must have shape (12,); got shape (1,)"),
    "tau nan": ({"tau": with_entry(V, 1, NAN)}, "tau must be finite; entry [1] is nan"),
}


@pytest.mark.parametrize("case", STATES)
@pytest.mark.parametrize("road", ["solve", "acceleration", "project"])
def test_states_that_do_not_fit(road, case):
    given, message = STATES[case]
    if road == "project" and "tau" in given:
        return
    with refuses(message, (InputError, UnknownNameError)):
        getattr(pn.Scene(MODEL), road)(**{"q": Q, "v": V, **given})


def test_lists_and_integers_are_fine():
    scene = pn.Scene(MODEL)
    expected = scene.acceleration(Q, V)
    np.testing.assert_array_equal(scene.acceleration(Q.tolist(), V.astype(int)), expected)
    np.testing.assert_allclose(scene.solve(Q.tolist(), V.astype(int)).a, expected, rtol=1e-13)


@pytest.mark.parametrize("modes", [[], [2], ["slip"], [b"\x80"], [1, 1], 1])
def test_modes_that_are_none(modes):
    scene = pn.Scene(MODEL, laws=[pn.JointFriction("j0", coulomb=1.0)])
    with refuses(f"modes must hold 1 numbers out of -1, 0, 1; got {modes}", InputError):
        scene.solve(Q, V, modes=modes)


def test_a_velocity_that_overflows_on_the_constraints():
    """The connecting rod of the four-bar turns faster than its crank."""
    scene = pn.load("four_bar")
    with refuses("v: the velocity on the constraints overflows; give a slower one", NonFiniteError):
        scene.project(v=np.full(3, 1.7e308))
