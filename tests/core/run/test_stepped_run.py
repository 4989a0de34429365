"""Single steps for user loops and runs as arrays: bitwise the same motion as `simulate`."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ...support.refusals import refuses

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


def pushed(limit: float) -> pn.Scene:
    """A block of 1 kg on a rail with friction of 1 N; its torque function raises from `limit` seconds on."""
    model = pin.Model()
    block = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "slide")
    model.appendBodyToJoint(block, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())

    def torque(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        if t >= limit:
            raise ValueError("no torque from here on")
        return np.full(1, 3.0)

    return pn.Scene(model, laws=[pn.JointFriction("slide", coulomb=1.0)], actuation=torque)


def test_a_stepper_shows_its_state() -> None:
    """Under 3 N the block has x = t^2; under half a newton it sticks."""
    stepper = pushed(np.inf).stepper(0.1, method="rk4", dt=0.1)
    stepper.step()
    assert repr(stepper) == "<Stepper at t = 0.1 s>"
    assert stepper.q == pytest.approx([0.01], rel=1e-12)
    assert stepper.v == pytest.approx([0.2], rel=1e-12)
    assert stepper.modes.tolist() == [1]
    stepper.reset(np.zeros(1), np.zeros(1), t=2.0, tau=[0.5])
    assert stepper.t == 2.0
    assert stepper.modes.tolist() == [0]
    stepper.step()
    assert (stepper.q == 0.0).all()


def test_a_stepper_that_has_stopped_begins_anew() -> None:
    stepper = pushed(0.15).stepper(0.1, method="rk4", dt=0.1)
    stepper.step()
    with pytest.raises(pn.UserFunctionError, match="no torque from here on"):
        stepper.step()
    assert repr(stepper) == "<Stepper stopped>"
    for use in (stepper.step, lambda: stepper.q, lambda: stepper.v, lambda: stepper.t):
        with refuses("Stepper: the run has stopped; start a new run with reset(q, v)", pn.InputError):
            use()
    stepper.reset(np.zeros(1), np.zeros(1))
    stepper.step({"slide": 2.0})  # a torque by name acts in place of the function
    assert stepper.q == pytest.approx([0.005], rel=1e-12)


@pytest.mark.parametrize("tau", [[1e308], {"slide": 1e308}])
def test_a_stepper_names_a_motion_that_overflows(tau: list[float] | dict[str, float]) -> None:
    stepper = pushed(np.inf).stepper(1e10, method="rk4", dt=1e10)
    with pytest.raises(pn.NonFiniteError, match="not finite"):
        stepper.step(tau)


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
    with pytest.raises(pn.InputError, match="records only states"):
        pn.rollout(scene, np.tile(q, (3, 1)), speeds, 0.2, record="a", as_arrays=True)


def test_arrays_name_runs_off_their_constraints(monkeypatch: pytest.MonkeyPatch) -> None:
    """With a tolerance of zero every closed loop counts as open."""
    monkeypatch.setattr("pin_nonideal.simulation.rollout_arrays.MAX_RESIDUAL", 0.0)
    scene = pn.load("four_bar")
    q, v = scene.initial_state()
    runs = pn.rollout(scene, np.tile(q, (2, 1)), np.tile(v, (2, 1)), 0.1, as_arrays=True, failures="keep")
    assert set(runs.failures) == {0, 1}
    assert isinstance(runs.failures[1], pn.LoopClosureError)
    assert str(runs.failures[1]).startswith(f"run 1 has left its constraints: gap {runs.violation[1]:.1e} (m")


def test_arrays_are_interrupted_as_lists_are() -> None:
    interrupts: list[float] = []

    def torque(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        if t > 0.1:
            interrupts.append(t)
            raise KeyboardInterrupt
        return np.zeros(1)

    model = pushed(np.inf).model
    scene = pn.Scene(model, actuation=torque)
    for arrays in (False, True):
        with pytest.raises(pn.RunInterrupted):
            pn.rollout(scene, np.zeros((2, 1)), None, 1.0, as_arrays=arrays, failures="keep")
    assert interrupts


def test_a_loop_of_many_steps_goes_on() -> None:
    """Each step is a separate run for the checks that end runs without progress."""
    scene = pn.load("loaded_joint")
    q, v = scene.initial_state()
    first = scene.step(q, v, None, 1e-6)
    for _ in range(20_100):
        again = scene.step(q, v, None, 1e-6)
    for one, other in zip(first, again, strict=True):
        np.testing.assert_array_equal(one, other)
