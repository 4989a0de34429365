"""User functions that raise or return invalid values during a run: the error names them, samples are kept."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys

import numpy as np
import pytest

import pin_nonideal as pn
from pin_nonideal.errors import InputError, RunInterrupted, UserFunctionError

from ..support.random_trees import tree
from ..support.refusals import refuses

MODEL = tree(["revolute x", "prismatic y", "revolute z"], np.random.default_rng(0), parents=[0, 1, 2])
ROW = np.array([[1.0, 0.0, 0.0]])
LATE = 0.5


def later(good, bad):
    """Return a function that fails from t = 0.5 s."""

    def call(t, *rest):
        if t <= LATE:
            return good
        if isinstance(bad, Exception):
            raise bad
        return bad

    return call


def constraint(**parts):
    given = {"function": lambda *_: (ROW, [0.0]), "rate": lambda t, q, v: ROW @ v, **parts}
    return pn.UserConstraint(given.pop("function"), 1, name="own", **given)


def ball(t, q):
    return [1.0, 0.0, 0.0]


NAN3 = np.array([0.0, np.nan, 0.0])
CASES = {
    "torque raises": (
        {"actuation": later(np.zeros(3), ValueError("no key"))},
        "actuation raised ValueError: no key",
    ),
    "torque shape": (
        {"actuation": later(np.zeros(3), np.zeros(7))},
        "actuation must return shape (3,); got shape (7,)",
    ),
    "torque None": (
        {"actuation": later(np.zeros(3), None)},
        "actuation must return shape (3,); got shape ()",
    ),
    "torque word": (
        {"actuation": later(np.zeros(3), "off")},
        "actuation must return numbers of shape (3,); got 'off'",
    ),
    "torque complex": (
        {"actuation": later(np.zeros(3), np.full(3, 1.0j))},
        "actuation must return numbers of shape (3,); got array([0.+1.j, 0.+1.j, 0.+1.j])",
    ),
    "torque nan": (
        {"actuation": later(np.zeros(3), NAN3)},
        "actuation must return finite numbers; got [ 0. nan  0.]",
    ),
    "sampled": (
        {"actuation": pn.SampledControl(later(np.zeros(3), KeyError("gain")), 0.1, name="servo")},
        "SampledControl \"servo\": function raised KeyError: 'gain'",
    ),
    "force": (
        {"forces": [pn.UserForce(later(np.zeros(3), NAN3), name="push")]},
        'UserForce "push": function must return finite numbers; got [ 0. nan  0.]',
    ),
    "wrench": (
        {"forces": [pn.Wrench("j2 tip", later(np.zeros(6), np.zeros(3)), name="pull")]},
        'Wrench "pull": value must return shape (6,); got shape (3,)',
    ),
    "law": (
        {"laws": [pn.UserLaw(later(np.zeros(3), ZeroDivisionError("by zero")), name="mud")]},
        'UserLaw "mud": function raised ZeroDivisionError: by zero',
    ),
    "law with states": (
        {"laws": [pn.UserLaw(later((np.zeros(3), np.zeros(1)), np.zeros(3)), states=1, name="mud")]},
        'UserLaw "mud": function must return 2 values; got ndarray',
    ),
    "law states nan": (
        {"laws": [pn.UserLaw(later((np.zeros(3), [0.0]), (np.zeros(3), [np.inf])), states=1, name="mud")]},
        'UserLaw "mud": function must return finite numbers; got [inf]',
    ),
    "friction direction": (
        {"laws": [pn.UserFriction(later(ball(0, 0), [1.0]), lambda *_: 0.1, name="pad")]},
        'UserFriction "pad": direction must return shape (3,); got shape (1,)',
    ),
    "friction limit": (
        {"laws": [pn.UserFriction(ball, later(0.1, -1.0), name="pad")]},
        'UserFriction "pad": limit must not be negative; got -1',
    ),
    "friction limit nan": (
        {"laws": [pn.UserFriction(ball, later(0.1, np.nan), name="pad")]},
        'UserFriction "pad": limit must return finite numbers; got nan',
    ),
    "rows": (
        {"constraints": [constraint(function=later((ROW, [0.0]), (ROW, [0.0, 1.0])))]},
        'UserConstraint "own": function must return shape (1,); got shape (2,)',
    ),
    "rows None": (
        {"constraints": [constraint(function=later((ROW, [0.0]), None))]},
        'UserConstraint "own": function must return 2 values; got NoneType',
    ),
    "residual": (
        {"constraints": [constraint(residual=lambda t, q: q[:1] if t <= LATE else [np.nan])]},
        'UserConstraint "own": residual must return finite numbers; got [nan]',
    ),
    "rate": (
        {"constraints": [constraint(rate=lambda t, q, v: v[:1] if t <= LATE else v)]},
        'UserConstraint "own": rate must return shape (1,); got shape (3,)',
    ),
    "motion": (
        {"constraints": [pn.PrescribedMotion("j0", later((0.0, 0.0, 0.0), (1.0,)), name="drive")]},
        'PrescribedMotion "drive": function of time must return 3 values; got tuple',
    ),
    "motion nan": (
        {"constraints": [pn.PrescribedMotion("j0", later((0.0,) * 3, (0.0, 0.0, np.nan)), name="drive")]},
        'PrescribedMotion "drive": function of time must return finite numbers; got nan',
    ),
    "motion raises": (
        {"constraints": [pn.PrescribedMotion("j0", later((0.0,) * 3, OSError("gone")), name="drive")]},
        'PrescribedMotion "drive": function of time raised OSError: gone',
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_what_fails_in_mid_run_is_named_and_the_samples_are_kept(case):
    keywords, message = CASES[case]
    scene = pn.Scene(MODEL, **keywords)
    with refuses(message, UserFunctionError) as caught:
        pn.simulate(scene, 2.0, rtol=1e-6, output_dt=0.1)
    error = caught.value
    run = error.trajectory
    np.testing.assert_allclose(run.t, 0.1 * np.arange(len(run)), atol=1e-12)
    assert 0.1 <= run.t[-1] < LATE + 0.11  # a sampled control is called at the next sample
    assert error.time == pytest.approx(run.t[-1])
    assert np.isfinite(run.q).all()
    if "raise" in message:
        assert error.__cause__ is not None
    # The scene remains valid.
    assert len(pn.simulate(scene, 0.2, rtol=1e-6, output_dt=0.1)) == 3


@pytest.mark.parametrize("method", ["dopri5", "rk4", "semi_implicit_euler", "moreau"])
def test_every_method_keeps_the_samples(method):
    scene = pn.Scene(MODEL, actuation=later(np.zeros(3), ValueError("no key")))
    fixed = {} if method == "dopri5" else {"dt": 0.01}
    with refuses("actuation raised ValueError: no key", UserFunctionError) as caught:
        pn.simulate(scene, 2.0, method=method, **fixed)
    assert 0.2 < caught.value.trajectory.t[-1] < 0.52


def test_a_rollout_names_the_state_that_failed():
    def torque(t, q, v):
        if v[0] > 5.0:
            raise ValueError("too fast")
        return np.zeros(3)

    v = np.zeros((3, 3))
    v[1, 0] = 6.0
    with refuses("actuation raised ValueError: too fast", UserFunctionError) as caught:
        pn.rollout(pn.Scene(MODEL, actuation=torque), np.zeros((3, 3)), v, 0.05)
    assert caught.value.index == 1


@pytest.mark.parametrize("road", ["solve", "acceleration"])
def test_one_instant(road):
    scene = pn.Scene(MODEL, actuation=later(np.zeros(3), ValueError("no key")))
    with refuses("actuation raised ValueError: no key", UserFunctionError):
        getattr(scene, road)(np.zeros(3), np.zeros(3), t=1.0)


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda r: r["lop"], 'no constraint "lop" in this scene; nearest: "loop"'),
        (lambda r: r.wrench("lop")[:3], 'no joint or constraint "lop" in this scene; nearest: "loop"'),
    ],
)
def test_a_law_that_asks_for_a_reaction_that_is_not_there(ask, message):
    law = pn.UserLaw(lambda t, q, v, r: ask(r), name="mud")
    loop = pn.PrescribedMotion("j0", pn.constant(0.0), name="loop")
    with refuses(f'UserLaw "mud": function raised UnknownNameError: {message}', UserFunctionError):
        pn.Scene(MODEL, constraints=[loop], laws=[law]).solve(np.zeros(3), np.zeros(3))


MISS = (
    r"; row 0: -?[\d.]+ by differences against -?[\d.]+; "
    r"correct the function, the residual or gap, or the rate"
)
DOOR = {
    "rate": (
        {"residual": lambda t, q: 2.0 * q[:1], "rate": lambda t, q, v: v[:1]},
        'UserConstraint "own": d residual/dt must equal rate',
    ),
    "b": (
        {"function": lambda *_: (ROW, [1.0]), "residual": lambda t, q: q[:1]},
        'UserConstraint "own": d rate/dt must equal A a - b',
    ),
    "A": (
        {"function": lambda *_: (2.0 * ROW, [0.0]), "rate": lambda t, q, v: v[:1]},
        'UserConstraint "own": d rate/dt must equal A a - b',
    ),
}


@pytest.mark.parametrize("case", DOOR)
def test_derivatives_of_a_constraint_are_checked_at_its_first_use(case):
    parts, message = DOOR[case]
    scene = pn.Scene(MODEL, constraints=[constraint(**parts)])
    with pytest.raises(InputError, match=message + MISS):
        scene.project()


def test_a_constraint_that_raises_at_its_first_use():
    own = constraint(function=lambda *_: 1 / 0, residual=lambda t, q: q[:1])
    scene = pn.Scene(MODEL, constraints=[own])
    with refuses(
        'UserConstraint "own": function raised ZeroDivisionError: division by zero', UserFunctionError
    ):
        scene.project()


# --- Ctrl-C -----------------------------------------------------------------------------------------------

INTERRUPTED = """
import sys

import numpy as np
import pin_nonideal as pn

scene = pn.load("four_bar")
if sys.argv[1] == "python":
    zero = np.zeros(scene.model.nv)
    scene = pn.Scene(scene.model, constraints=scene.constraints, q0=scene.q0, actuation=lambda t, q, v: zero)
print("ready", flush=True)
try:
    pn.simulate(scene, 1e6, rtol=1e-10)
except pn.RunInterrupted as error:
    run = error.trajectory
    print(error, len(run), run.t[-1] == error.time, bool(np.isfinite(run.q).all()), error.__cause__, sep="|")
"""


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize("kind", ["core", "python"])
def test_ctrl_c_keeps_what_was_computed(kind):
    child = subprocess.Popen(
        [sys.executable, "-c", INTERRUPTED, kind], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        assert child.stdout.readline() == "ready\n"
        with pytest.raises(subprocess.TimeoutExpired):
            child.wait(0.5)
        child.send_signal(signal.SIGINT)
        out, err = child.communicate(timeout=20)
    finally:
        child.kill()
    assert child.returncode == 0, err
    message, samples, at_end, finite, cause = out.strip().split("|")
    pattern = r"the run was interrupted at t = \S+ s; the trajectory up to this time is in error\.trajectory"
    assert re.fullmatch(pattern, message)
    assert int(samples) > 10
    assert (at_end, finite, cause) == ("True", "True", "None")
    assert issubclass(RunInterrupted, KeyboardInterrupt)


# --- functions of time -------------------------------------------------------------------------------------

WRONG_DERIVATIVES = {
    "no rate": (
        lambda t: (2.0 * t, 0.0, 0.0),
        "rate must be the derivative of value; at t = 0.01371 s it returns 0",
    ),
    "sign": (
        lambda t: (np.cos(t), -np.sin(t), np.cos(t)),
        "acceleration must be the derivative of rate; at t = 0.01371 s it returns 0.999906",
    ),
}


@pytest.mark.parametrize("case", WRONG_DERIVATIVES)
def test_wrong_derivatives_of_a_function_of_time(case):
    function, message = WRONG_DERIVATIVES[case]
    with refuses(f'PrescribedMotion "drive": function of time: {message}', pn.InputError):
        pn.Scene(MODEL, constraints=[pn.PrescribedMotion(MODEL.names[1], function, name="drive")])


@pytest.mark.parametrize(
    "function",
    [
        lambda t: (max(0.0, t - 0.21317), float(t > 0.21317), 0.0),  # a corner on a probe
        lambda t: (np.interp(t, [0, 1], [0, 1]), 1.0, 0.0) if t < 0.1 else (None, None, None),
        lambda t: (1e6 + 1e-3 * t, 1e-3, 0.0),  # differences drown in rounding
    ],
)
def test_functions_of_time_that_pass(function):
    pn.Scene(MODEL, constraints=[pn.PrescribedMotion(MODEL.names[1], function, name="drive")])


def test_arrays_that_a_function_keeps_stay_as_they_were():
    """The core reuses argument arrays unless the function keeps them: whole, as a view, or in a list."""
    kept, views, told = [], [], []

    def torque(t, q, v):
        kept.append(q)
        views.append(v[1:])
        told.append((q.tolist(), v.tolist()[1:]))
        return np.zeros(3)

    def touched(t, q, v):
        q[:] = v[:] = np.nan  # changes of the arguments have no effect
        return np.zeros(3)

    q0 = np.array([0.1, 0.2, 0.3])
    pn.simulate(pn.Scene(MODEL, actuation=torque), 0.05, q=q0)
    assert len(kept) > 20
    assert [q.tolist() for q in kept] == [q for q, _ in told]
    assert [v.tolist() for v in views] == [v for _, v in told]
    plain, own = (
        pn.simulate(pn.Scene(MODEL, actuation=f), 0.05, q=q0) for f in (lambda t, q, v: np.zeros(3), touched)
    )
    np.testing.assert_array_equal(plain.q, own.q)


def test_an_array_is_used_again_where_nobody_keeps_it():
    seen = set()

    def torque(t, q, v):
        seen.add(q.ctypes.data)
        return np.zeros(3)

    run = pn.simulate(pn.Scene(MODEL, actuation=torque), 0.1, q=np.array([0.1, 0.2, 0.3]))
    assert run.stats.evaluations > 20
    assert len(seen) <= 4
