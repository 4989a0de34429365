"""Runs and rollouts that cannot start: each gives a named error, in these words."""

from __future__ import annotations

import numpy as np
import pytest

import pin_nonideal as pn
from pin_nonideal.errors import InputError

from ..support.every_joint import INF, MODEL, NAN, Q, V, with_entry
from ..support.refusals import refuses

METHODS = "'dop853', 'dopri5', 'rk4', 'semi_implicit_euler', 'moreau', 'Radau', 'BDF', 'LSODA'"
RUNS = {
    "duration zero": ({"duration": 0}, "simulate: duration must be positive; got 0"),
    "duration negative": ({"duration": -1.0}, "simulate: duration must be positive; got -1"),
    "duration nan": ({"duration": NAN}, "simulate: duration must be finite; got nan"),
    "duration inf": ({"duration": INF}, "simulate: duration must be finite; got inf"),
    "duration word": ({"duration": "long"}, "simulate: duration must be a number; got 'long'"),
    "t0": ({"t0": NAN}, "simulate: t0 must be finite; got nan"),
    "method": (
        {"method": "dop583"},
        f"simulate: method must be one of {METHODS}; got 'dop583'; nearest: \"dop853\"",
    ),
    "method far": ({"method": "verlet"}, f"simulate: method must be one of {METHODS}; got 'verlet'"),
    "method number": ({"method": 4}, f"simulate: method must be one of {METHODS}; got 4"),
    "rtol": ({"rtol": -1e-6}, "simulate: rtol must not be negative; got -1e-06"),
    "rtol nan": ({"rtol": NAN}, "simulate: rtol must be finite; got nan"),
    "atol": ({"atol": -1.0}, "simulate: atol must not be negative; got -1"),
    "atol bytes": (
        {"atol": ["", b"\x80"]},
        "simulate: atol must be an array of numbers of shape (24,); got ['', b'\\x80']",
    ),
    "atol shape": ({"atol": [1e-9]}, "simulate: atol must have shape (24,); got shape (1,)"),
    "atol entries": ({"atol": np.full(24, -2.0)}, "simulate: atol must not be negative; got -2"),
    "both zero": (
        {"rtol": 0, "atol": 0},
        "simulate: rtol and atol must not both be zero; set one of them",
    ),
    "dt": (
        {"dt": 0.1},
        'simulate: method "dop853" chooses its own steps; leave dt out, or set output_dt',
    ),
    "no dt": ({"method": "rk4"}, 'simulate: method "rk4" needs a step dt'),
    "dt zero": ({"method": "rk4", "dt": 0.0}, "simulate: dt must be positive; got 0"),
    "dt negative": ({"method": "moreau", "dt": -0.1}, "simulate: dt must be positive; got -0.1"),
    "dt nan": ({"method": "rk4", "dt": NAN}, "simulate: dt must be finite; got nan"),
    "fixed with rtol": (
        {"method": "rk4", "dt": 0.1, "rtol": 1e-6, "atol": 1e-6},
        'simulate: method "rk4" takes steps of the length dt; leave rtol and atol out',
    ),
    "output_dt": ({"output_dt": 0.0}, "simulate: output_dt must be positive; got 0"),
    "duration without steps": (
        {"duration": 1.0, "t0": 1e15},
        "simulate: duration must be at least 100 times the spacing of floating-point times, which is 0.12 s "
        "at t = 1e+15 s; got 1 s",
    ),
    "dt without end": (
        {"method": "rk4", "dt": 1e-300},
        "simulate: dt must be at least 100 times the spacing of floating-point times, which is 2.2e-16 s at "
        "t = 1 s; got 1e-300 s",
    ),
    "output_dt without end": (
        {"output_dt": 1e-300},
        "simulate: output_dt must be at least 100 times the spacing of floating-point times",
    ),
    "too many samples": (
        {"output_dt": 1e-9},
        "simulate: output_dt must leave at most 1e+08 samples; 1e-09 s leaves 1e+09; set a longer output_dt",
    ),
    "too many steps kept": (
        {"method": "rk4", "dt": 1e-9},
        "simulate: dt must leave at most 1e+08 samples; 1e-09 s leaves 1e+09; set a longer output_dt",
    ),
    "record": (
        {"record": "energi"},
        "simulate: record must be one of 'a', 'forces', 'contact_points', 'energy', 'power', 'laws', "
        "'reactions', 'tau', 'dense'; "
        "got 'energi'; nearest: \"energy\"",
    ),
    "record list": ({"record": 3}, "simulate: record must be a list; got 3"),
    "progress": ({"progress": "bar"}, "simulate: progress must be one of True, False, None; got 'bar'"),
    "q": ({"q": [0.0]}, "q must have shape (15,); got shape (1,)"),
    "v": ({"v": with_entry(V, 0, NAN)}, "v must be finite; entry [0] is nan"),
}


@pytest.mark.parametrize("case", RUNS)
def test_runs_that_cannot_start(case):
    given, message = RUNS[case]
    with refuses(message, InputError):
        pn.simulate(pn.Scene(MODEL), **{"duration": 1.0, **given})


def test_a_period_without_end():
    control = pn.SampledControl(lambda t, q, v: np.zeros(MODEL.nv), 1e-300)
    with refuses("SampledControl: period must be at least 100 times the spacing", InputError):
        pn.simulate(pn.Scene(MODEL, actuation=control), 1.0)


def test_more_periods_than_a_run_can_call():
    control = pn.SampledControl(lambda t, q, v: np.zeros(MODEL.nv), 1e-12)
    message = (
        "SampledControl: period must leave at most 1e+08 calls in a run; 1e-12 s leaves 1e+12; "
        "set a longer period"
    )
    with refuses(message, InputError):
        pn.simulate(pn.Scene(MODEL, actuation=control), 1.0)


def test_a_run_needs_a_scene():
    with refuses("simulate: scene must be a Scene; got Model", InputError):
        pn.simulate(MODEL, 1.0)
    with refuses("rollout: scene must be a Scene; got Model", InputError):
        pn.rollout(MODEL, Q[None], V[None], 1.0)


ROLLOUTS = {
    "no runs": (
        {"q": None, "v": None},
        "rollout needs states or parameters of its runs: rollout(scene, q, v, duration)",
    ),
    "no duration": ({"duration": None}, "simulate: duration must be a number; got None"),
    "failures": ({"failures": "drop"}, "rollout: failures must be one of 'raise', 'keep'; got 'drop'"),
    "one state": ({"q": Q, "v": V}, "rollout: q must have shape (n, 15); got shape (15,)"),
    "rows": (
        {"q": np.tile(Q, (2, 1))},
        "rollout: q and v must have as many rows; got 2 and 1",
    ),
    "jobs": ({"jobs": 0}, "rollout: jobs must not be zero"),
    "jobs many": ({"jobs": 2**31}, "rollout: jobs must be at most 1000000000; got 2147483648"),
    "jobs float": ({"jobs": 1.5}, "rollout: jobs must be an integer; got 1.5"),
    "method array": (
        {"method": np.zeros(0)},
        f"simulate: method must be one of {METHODS}; got array([], dtype=float64)",
    ),
    "method": ({"method": "Radau"}, 'rollout: method must be one of the core\'s; "Radau" runs in SciPy'),
    "length": (
        {"q": 0.5 * Q[None]},
        'q: the quaternion of joint "j2" must have length 1; got 0.5; normalize it',
    ),
}


@pytest.mark.parametrize("case", ROLLOUTS)
def test_rollouts_that_cannot_start(case):
    given, message = ROLLOUTS[case]
    with refuses(message, InputError):
        pn.rollout(pn.Scene(MODEL), **{"q": Q[None], "v": V[None], "duration": 0.1, **given})
