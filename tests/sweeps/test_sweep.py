"""Many runs at once: sweeps over parameters and rollouts over states."""

from __future__ import annotations

import os
import re
import signal
import threading
import time

import joblib
import numpy as np
import pytest

import pin_nonideal as pn

from ..support.same_run import assert_same_run


def ladder(**parameters):
    return pn.load("n_four_bar", **parameters)


@pytest.mark.parametrize("backend", ["threading", "loky"])
def test_a_sweep_is_its_runs_one_by_one(backend):
    parameters = [{"N": 1}, {"N": 3}]
    with joblib.parallel_config(backend=backend):
        runs = pn.sweep(ladder, parameters, 0.1, jobs=2, output_dt=0.05)
    for run, p in zip(runs, parameters, strict=True):
        alone = pn.simulate(ladder(**p), 0.1, output_dt=0.05)
        assert_same_run(run, alone)


def test_parameters_must_be_mappings():
    message = "sweep: parameters must hold mappings of keyword arguments; got 3"
    with pytest.raises(pn.InputError, match=f"^{re.escape(message)}$"):
        pn.sweep(ladder, [3], 0.1)
    with pytest.raises(pn.InputError, match="sweep: parameters must be a list; got None"):
        pn.sweep(ladder, None, 0.1)
    with pytest.raises(pn.InputError, match="sweep: jobs must not be zero"):
        pn.sweep(ladder, [], 0.1, jobs=0)
    for jobs, bound in ((10**30, "most 100000"), (-(10**30), "least -100000")):
        with pytest.raises(pn.InputError, match=f"sweep: jobs must be at {bound}"):
            pn.sweep(ladder, [], 0.1, jobs=jobs)
    for jobs in (False, 2.0, float("nan"), "all"):
        with pytest.raises(pn.InputError, match="sweep: jobs must be an integer"):
            pn.sweep(ladder, [], 0.1, jobs=jobs)


@pytest.mark.parametrize("threads", [1, 2, 5])
@pytest.mark.parametrize("robot", ["four_bar", "n_four_bar", "panda_friction"])
def test_rollouts_are_bitwise_their_single_runs(robot, threads):
    scene = pn.load(robot)
    q, v = scene.initial_state()
    generator = np.random.default_rng(4)
    n = 6
    starts_v = np.array([v * (1.0 + 0.1 * generator.standard_normal()) for _ in range(n)])
    starts_q = np.tile(q, (n, 1))
    runs = pn.rollout(scene, starts_q, starts_v, 0.3, jobs=threads, record=("energy",))
    assert len(runs) == n
    for k, run in enumerate(runs):
        alone = pn.simulate(scene, 0.3, q=starts_q[k], v=starts_v[k], record=("energy",))
        assert_same_run(run, alone)


def test_python_functions_run_in_rollout_threads_as_well():
    model = pn.load("panda_friction").model
    scene = pn.Scene(model, actuation=lambda t, q, v: -2.0 * v)
    v = np.linspace(-1.0, 1.0, 4)[:, None] * np.ones(model.nv)
    runs = pn.rollout(scene, np.tile(scene.q0, (4, 1)), v, 0.05, jobs=3)
    for k, run in enumerate(runs):
        assert_same_run(run, pn.simulate(scene, 0.05, v=v[k], q=scene.q0))


def test_a_failing_state_is_named():
    model = pn.load("panda_friction").model

    def limited(t, q, v):
        if v[0] > 0.5:
            raise ValueError("too fast")
        return 0.0 * v

    scene = pn.Scene(model, actuation=limited)
    v = np.zeros((3, model.nv))
    v[1, 0] = 1.0
    with pytest.raises(pn.UserFunctionError, match="too fast") as caught:
        pn.rollout(scene, np.tile(scene.q0, (3, 1)), v, 0.05)
    assert caught.value.index == 1


@pytest.mark.parametrize("threads", [1, 3])
def test_an_interrupt_ends_all_runs(threads):
    model = pn.load("panda_friction").model
    begun = []

    def interrupting(t, q, v):
        if t == 0.0:
            begun.append(v[0])
        if threading.current_thread() is threading.main_thread() and t > 0.01:
            raise KeyboardInterrupt
        return 0.0 * v

    scene = pn.Scene(model, actuation=interrupting)
    v = 0.1 * np.arange(40)[:, None] * np.ones(model.nv)
    with pytest.raises(pn.RunInterrupted) as caught:
        pn.rollout(scene, np.tile(scene.q0, (40, 1)), v, 5.0, jobs=threads)
    assert 0.0 < caught.value.trajectory.t[-1] < 5.0
    assert caught.value.trajectory.v[0, 0] == v[caught.value.index, 0]
    assert len(set(begun)) <= threads + 1  # another thread may have ended a run before


def rollout_of_two(torque, duration):
    """Two states, one of them with each of two threads, while the torques are these."""
    model = pn.load("panda_friction").model
    scene = pn.Scene(model, actuation=lambda t, q, v: torque(t, in_main_thread()) * v)
    v = np.ones((2, model.nv)) * [[0.1], [0.2]]
    return pn.rollout(scene, np.tile(scene.q0, (2, 1)), v, duration, jobs=2)


def in_main_thread():
    return threading.current_thread() is threading.main_thread()


def test_an_interrupt_is_seen_when_the_calling_thread_has_nothing_left_to_do():
    failed, sent = [], []

    def torque(t, main):
        if main:
            time.sleep(0.2)  # meanwhile the other thread starts its run
            failed.append(time.monotonic())
            raise ValueError("this one ends early")
        if not sent and failed and time.monotonic() > failed[0] + 0.2:
            sent.append(t)
            os.kill(os.getpid(), signal.SIGINT)
        return 0.0

    with pytest.raises(pn.RunInterrupted) as caught:
        rollout_of_two(torque, 1e4)
    assert 0.0 < caught.value.trajectory.t[-1] < 1e4


def test_an_interrupt_in_another_thread_ends_the_run_of_the_calling_one():
    last = {True: 0.0, False: 0.0}

    def torque(t, main):
        last[main] = t
        if not main and t > 0.01:
            raise KeyboardInterrupt
        return 0.0

    with pytest.raises(pn.RunInterrupted):
        rollout_of_two(torque, 30.0)
    assert max(last.values()) < 30.0


def test_threads_beyond_the_states_are_not_started():
    scene = pn.load("four_bar")
    q, v = scene.initial_state()
    (run,) = pn.rollout(scene, q[None], v[None], 0.01, jobs=1_000_000_000)
    assert_same_run(run, pn.simulate(scene, 0.01))
