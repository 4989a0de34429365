"""Ctrl-C in the middle of runs, and threads against single runs, bit by bit."""

from __future__ import annotations

import subprocess
import sys
import textwrap

import numpy as np
import pytest

import pin_nonideal as pn

from ..support.same_run import assert_same_run

long = pytest.mark.stress

INTERRUPTED = """
    import os, signal, sys, threading
    import numpy as np
    import pin_nonideal as pn

    scene = pn.load(sys.argv[1])
    options = {"record": ("energy", "forces"), **eval(sys.argv[2])}
    pn.simulate(scene, 1e-3, **options)  # imports what the method needs: a signal must not hit an import
    threading.Timer(float(sys.argv[3]), lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    try:
        pn.simulate(scene, 1e6, **options)
    except pn.RunInterrupted as error:
        run = error.trajectory
        assert str(error).startswith("the run was interrupted at t = "), error
        assert 0.0 <= run.t[-1] < 1e6
        assert all(np.isfinite(x).all() for x in (run.t, run.q, run.v, run.lam, run.energy["total"]))
        assert (np.diff(run.t) > 0.0).all()
        again = pn.simulate(scene, 1e-3, **options)  # the scene is as good as before
        assert (again.q[0] == run.q[0]).all()
        print("kept", len(run))
"""


@pytest.mark.parametrize(
    ("robot", "options"),
    [
        ("four_bar", {"rtol": 1e-10}),
        ("belt_oscillator", {"output_dt": 0.5}),
        ("worm_drive", {"method": "moreau", "dt": 1e-4, "output_dt": 0.1}),
        pytest.param("andrews_squeezer", {"method": "rk4", "dt": 1e-5, "output_dt": 0.1}, marks=long),
        pytest.param("five_bar", {"method": "Radau"}, marks=long),
    ],
)
def test_ctrl_c_in_the_middle_keeps_the_samples(robot, options):
    """Ctrl-C stops a separate process at an arbitrary place of the loop."""
    wait = f"{np.random.default_rng().uniform(0.05, 0.6):.3f}"
    code = textwrap.dedent(INTERRUPTED)
    done = subprocess.run(
        [sys.executable, "-c", code, robot, repr(options), wait], capture_output=True, text=True, timeout=120
    )
    assert done.stdout.startswith("kept"), f"after {wait} s: {done.stderr}"


@pytest.mark.parametrize("threads", [2, 4, pytest.param(16, marks=long)])
@pytest.mark.parametrize("robot", ["four_bar", "belt_oscillator", "solo12_standing", "knife_edge_sleigh"])
def test_threads_give_the_bits_of_single_runs(robot, threads):
    scene, generator = pn.load(robot), np.random.default_rng(5)
    q, v = scene.initial_state()
    states = [scene.project(q, v * (1.0 + 0.1 * generator.standard_normal())) for _ in range(9)]
    options = {"rtol": 1e-6, "record": ("a", "forces", "energy"), "output_dt": 0.02}
    starts_q, starts_v = np.array([s[0] for s in states]), np.array([s[1] for s in states])
    together = pn.rollout(scene, starts_q, starts_v, 0.2, jobs=threads, **options)
    for run, (q0, v0) in zip(together, states, strict=True):
        alone = pn.simulate(scene, 0.2, q=q0, v=v0, **options)
        assert_same_run(run, alone)
