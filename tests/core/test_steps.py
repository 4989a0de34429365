"""Single steps for user loops and runs as arrays: bitwise the same motion as `simulate`."""

from __future__ import annotations

import numpy as np
import pytest

import pin_nonideal as pn

ROBOTS = (
    "four_bar",
    "rough_four_bar",
    "panda",
    "panda_friction",
    "loaded_joint",
    "belt_oscillator",
    "double_pendulum",
)
METHODS = ("semi_implicit_euler", "rk4", "moreau")


@pytest.fixture(scope="module", params=ROBOTS)
def scene(request: pytest.FixtureRequest) -> pn.Scene:
    return pn.load(request.param)


def torques(scene: pn.Scene) -> np.ndarray:
    return 0.3 * np.sin(np.arange(scene.model.nv) + 1.0)


def driven(scene: pn.Scene, tau: np.ndarray) -> pn.Scene:
    return pn.Scene(
        scene.model,
        constraints=scene.constraints,
        laws=scene.laws,
        contacts=scene.contacts,
        forces=scene.forces,
        actuation=tau,
        q0=scene.q0,
        v0=scene.v0,
    )


@pytest.mark.parametrize("method", METHODS)
def test_step_is_that_of_simulate(scene: pn.Scene, method: str) -> None:
    tau, (q, v) = torques(scene), scene.initial_state()
    runs = driven(scene, tau)
    for _ in range(5):
        run = pn.simulate(runs, 2e-3, q=q, v=v, method=method, dt=2e-3)
        on_q, on_v = run.q[0], run.v[0]  # the state is projected first
        q_next, v_next = scene.step(on_q, on_v, tau, 2e-3, method=method)
        assert (q_next == run.q[-1]).all()
        assert (v_next == run.v[-1]).all()
        q, v = q_next, v_next


def test_step_takes_lists_and_names_and_tells_what_is_wrong() -> None:
    scene = pn.load("four_bar")
    q, v = scene.initial_state()
    plain = scene.step(q, v, np.zeros(scene.model.nv), 1e-3)
    listed = scene.step(list(q), list(v), [0.0] * scene.model.nv, 1e-3)
    assert all((a == b).all() for a, b in zip(plain, listed, strict=True))
    with pytest.raises(pn.InputError, match="tau"):
        scene.step(q, v, [1.0], 1e-3)
    with pytest.raises(pn.InputError, match="dt must be positive"):
        scene.step(q, v, None, -1e-3)
    with pytest.raises(pn.InputError, match="method"):
        scene.step(q, v, None, 1e-3, method="dop853")


@pytest.mark.parametrize("method", [*METHODS, "dop853"])
def test_stepper_goes_on_as_one_run(scene: pn.Scene, method: str) -> None:
    fixed = method != "dop853"
    stepper = scene.stepper(0.01, method=method, dt=0.0025 if fixed else None)
    states = [stepper.step() for _ in range(20)]
    if fixed:
        run = pn.simulate(scene, 0.2, method=method, dt=0.0025, output_dt=0.01)
    else:
        run = pn.simulate(scene, 0.2, method=method, output_dt=0.01)
    run = run.samples(run.grid)
    assert stepper.t == pytest.approx(0.2, abs=1e-14)
    same = 1e-11 if fixed else 1e-6  # periods end steps, so step sizes differ
    assert np.abs(np.array([q for q, _ in states]) - run.q[1:]).max() < same * max(1.0, np.abs(run.q).max())
    assert np.abs(np.array([v for _, v in states]) - run.v[1:]).max() < same * max(1.0, np.abs(run.v).max())


def test_stepper_takes_torques() -> None:
    scene = pn.load("panda")
    tau = torques(scene)
    stepper = scene.stepper(0.01, method="rk4", dt=0.005)
    given = [stepper.step(tau if k % 2 else -tau)[0] for k in range(6)]
    q, v = scene.initial_state()
    for k in range(6):
        run = pn.simulate(driven(scene, tau if k % 2 else -tau), 0.01, q=q, v=v, method="rk4", dt=0.005)
        q, v = run.q[-1], run.v[-1]
        assert np.abs(given[k] - q).max() < 1e-12
    stepper.reset(*scene.initial_state())
    assert (stepper.step(-tau)[0] == given[0]).all()
    with pytest.raises(pn.InputError, match="tau"):
        stepper.step([1.0])
    with pytest.raises(pn.InputError, match="whole number of steps"):
        scene.stepper(0.01, dt=0.003)


@pytest.mark.parametrize("method", ["rk4", "dop853"])
@pytest.mark.parametrize("threads", [1, 2])
def test_arrays_are_the_samples_of_simulate(scene: pn.Scene, method: str, threads: int) -> None:
    q, v = scene.initial_state()
    starts_v = v + np.linspace(0.0, 0.2, 7)[:, None] * (v != 0.0)
    starts_q = np.tile(q, (7, 1))
    steps = {"dt": 1e-3} if method == "rk4" else {}
    runs = pn.rollout(scene, starts_q, starts_v, 0.02, method=method, jobs=threads, as_arrays=True, **steps)
    assert len(runs) == 7
    assert not runs.failures
    for i in range(7):
        run = pn.simulate(scene, 0.02, q=starts_q[i], v=starts_v[i], method=method, **steps)
        n = runs.samples[i]
        assert n == len(run)
        assert (runs.t[i, :n] == run.t).all()
        assert (runs.q[i, :n] == run.q).all()
        assert (runs.v[i, :n] == run.v).all()
        assert np.isnan(runs.t[i, n:]).all()
        assert runs.steps[i] == run.stats.steps
        assert (runs.last[0][i] == run.q[-1]).all()


def test_arrays_keep_failures_apart() -> None:
    """Only the run that exceeds its maximum number of steps fails."""
    scene = pn.load("four_bar")
    q, _ = scene.initial_state()
    speeds = np.array([0.0, 4000.0, 0.0])[:, None] * np.ones(scene.model.nv)
    runs = pn.rollout(scene, np.tile(q, (3, 1)), speeds, 0.2, max_steps=25, as_arrays=True, failures="keep")
    assert set(runs.failures) == {1}
    assert isinstance(runs.failures[1], pn.StepSizeError)
    assert runs.t[1, runs.samples[1] - 1] < 0.2
    with pytest.raises(pn.StepSizeError) as stopped:
        pn.rollout(scene, np.tile(q, (3, 1)), speeds, 0.2, max_steps=25, as_arrays=True)
    assert stopped.value.index == 1
    with pytest.raises(pn.InputError, match="states alone"):
        pn.rollout(scene, np.tile(q, (3, 1)), speeds, 0.2, record="a", as_arrays=True)


def test_a_loop_of_many_steps_goes_on() -> None:
    """Each step is a separate run for the checks that end runs without progress."""
    scene = pn.load("loaded_joint")
    q, v = scene.initial_state()
    first = scene.step(q, v, None, 1e-6)
    for _ in range(20_100):
        again = scene.step(q, v, None, 1e-6)
    for one, other in zip(first, again, strict=True):
        np.testing.assert_array_equal(one, other)
