"""Results of the public functions for a case, by name, and their comparison."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio as pin

import pin_nonideal as pn
from pin_nonideal.statics.residual import AtRest
from pin_nonideal.visualization.page.frames import sample

from .cases import Case
from .symmetries import Image, independent

# Rounding of sums of some hundred products, through factors of matrices with condition up to 1e6.
AT_ONCE = 1e-8
# Runs at rtol 1e-9: several hundred local errors, times the growth of nearby motions.
OF_RUNS = 1e-6
# Roots by Newton's method or by bisection to 1e-9, with a stiffness of 1e-3 of the largest.
OF_SEARCHES = 1e-6
# Several hundred different steps of a first-order method.
OF_FIRST_ORDER = 3e-2
# Reference values by kind, such as gravity times 1 kg. Values below this relative size are rounding.
FLOORS = {"q": 0.1, "v": 0.1, "a": 10.0, "force": 1.0, "t": 0.1, "energy": 1.0, "number": 1.0, "rates": 1.0}
MIN_LOAD = 1e-3  # N m
MIN_ENERGY = 1e-3  # J
WALL = 30.0  # wall time of one run [s]


@dataclass(frozen=True)
class Answer:
    """Values by name, each with its kind (for `Image.back`), and a common tolerance.

    Attributes:
        first_order: whether a first-order method computed the values.
        energy: largest energy of a run, the reference of works.
    """

    values: dict[str, tuple[str, Any]]
    tolerance: float = AT_ONCE
    first_order: bool = False
    energy: float = 0.0


FUNCTIONS: dict[str, Callable[[Case], Answer]] = {}
RUNS: set[str] = set()
STATIC: set[str] = set()


def function(name: str, *, run: bool = False, static: bool = False) -> Any:
    """Register a function that computes results for a case."""

    def register(f: Callable[[Case], Answer]) -> Callable[[Case], Answer]:
        FUNCTIONS[name] = f
        RUNS.update([name] * run)
        STATIC.update([name] * static)
        return f

    return register


def ask(name: str, case: Case) -> Answer:
    """Return the result of a function, or the kind of its error."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return FUNCTIONS[name](case)
    except pn.PinNonidealError as error:
        return Answer({"error": ("error", f"{type(error).__name__}: {error}")})


def multipliers(scene: pn.Scene, lam: np.ndarray) -> dict[str, np.ndarray]:
    return {name: lam[..., rows] for name, rows in scene.constraint_slices.items()}


# --- One instant ----------------------------------------------------------------------------------------


@function("solve")
def _(case: Case) -> Answer:
    scene, values = case.scene, {}
    for k, (q, v) in enumerate(case.states):
        s = scene.solve(q, v, case.t0)
        values[f"a {k}"] = ("a", s.a)
        values[f"F {k}"] = ("force", s.F_ideal + s.F_nonideal)
        values[f"lam {k}"] = ("lam", multipliers(scene, s.lam))
        values[f"modes {k}"] = ("by element", dict(zip(scene.element_names, s.modes.tolist(), strict=True)))
        values[f"closed {k}"] = ("by element", dict(zip(scene.contact_names, s.closed.tolist(), strict=True)))
        if scene.laws or scene.contacts or len(scene.constraint_slices):
            values[f"F_nonideal {k}"] = ("force", s.F_nonideal)
        values[f"rank {k}"] = ("rank", s.rank)
    return Answer(values)


@function("acceleration")
def _(case: Case) -> Answer:
    return Answer(
        {f"a {k}": ("a", case.scene.acceleration(q, v, t=case.t0)) for k, (q, v) in enumerate(case.states)}
    )


@function("project")
def _(case: Case) -> Answer:
    values: dict[str, tuple[str, Any]] = {}
    for k, (q, v) in enumerate(case.off):
        at, speed = case.scene.project(q, v, case.t0)
        values[f"q {k}"], values[f"v {k}"] = ("q", at), ("v", speed)
    return Answer(values, OF_SEARCHES)


@function("named velocities")
def _(case: Case) -> Answer:
    """Project with the named velocity of the first joint only; it is kept and the others follow."""
    scene, values = case.scene, {}
    model, (q, v) = scene.model, case.states[0]
    own = [name for name in sorted(own_joints(model)) if model.joints[model.getJointId(name)].nv == 1]
    for name in own[:3]:
        dof = model.joints[model.getJointId(name)].idx_v
        try:
            _, speed = scene.project(q, {name: 1.3 * v[dof]}, case.t0)
        except pn.InputError:
            values[f"v of {name}"] = ("flag", "refused")
            continue
        values[f"v of {name}"] = ("v", speed)
        assert abs(speed[dof] - 1.3 * v[dof]) <= 1e-9 * np.abs(speed).max(), name
    return Answer(values, OF_SEARCHES)


# --- Statics --------------------------------------------------------------------------------------------


@function("rest", static=True)
def _(case: Case) -> Answer:
    found = pn.rest(case.scene, case.states[0][0], t=case.t0)
    return Answer({"rests": ("flag", found.rests), "margin": ("number", found.margin)}, OF_SEARCHES)


@function("equilibrium", static=True)
def _(case: Case) -> Answer:
    found = pn.equilibrium(case.scene, case.states[0][0], t=case.t0, starts=1)
    values: dict[str, tuple[str, Any]] = {"stable": ("stable", found.stable)}
    if found.stable is not None:  # else the equilibrium is one of a continuum
        values |= {"rates": ("rates", np.real(found.rates)), "q": ("place of rest", found.q)}
    return Answer(values, OF_SEARCHES)


def own_joints(model: pin.Model) -> list[str]:
    """Return the joints of the case, without joints that an image adds."""
    return [str(name) for name in model.names[1:] if name not in ("mount", "split", "added wheel")]


@function("inverse_dynamics")
def _(case: Case) -> Answer:
    """Compute torques for the accelerations of the states, and torques that hold the start."""
    scene, values = case.scene, {}
    for k, (q, v) in enumerate(case.states):
        a = scene.acceleration(q, v, t=case.t0)
        found = pn.inverse_dynamics(scene, q, v, a, actuated=own_joints(scene.model), t=case.t0)
        again = scene.acceleration(q, v, tau=found.tau, t=case.t0)
        values[f"left {k}"] = ("small force", found.left)
        values[f"work {k}"] = ("power", found.tau @ v)
        values[f"a again {k}"] = ("a", again)
    return Answer(values, OF_SEARCHES)


@function("holding torques", static=True)
def _(case: Case) -> Answer:
    """Compute the torque of each joint that alone can hold the start against all applied forces."""
    scene, values = case.scene, {}
    model, q = scene.model, case.states[0][0]
    still = np.zeros(model.nv)
    for name in sorted(own_joints(model)):
        joint = model.joints[model.getJointId(name)]
        if joint.nv != 1 or len(values) > 6:
            continue
        found = pn.inverse_dynamics(scene, q, still, still, actuated=[name], t=case.t0)
        size = max(float(np.abs(found.tau).max()), MIN_LOAD * case.units.energy)
        if found.left <= 1e-7 * size:
            values[f"tau of {name}"] = ("force", found.tau)
        else:
            values[f"tau of {name}"] = ("flag", "does not hold")
    return Answer(values, OF_SEARCHES)


# --- Runs -----------------------------------------------------------------------------------------------

# Events that are compared, and the smallest impact: smaller rebounds are summed up.
EVENTS, MIN_STRIKE = ("stick", "slip", "reverse", "impact", "touch_down", "lift_off"), 1e-3
RECORD = ("a", "forces", "energy")


def simulated(case: Case, method: str, **more: Any) -> list[pn.Trajectory]:
    """Return the trajectories of the parts of a run."""
    if case.method is not None and method in ("dop853",):
        method = case.method
    own: dict[str, Any] = {
        "method": method,
        "record": RECORD,
        "output_dt": case.duration / case.outputs / case.finer,
    }
    if method in ("dop853", "dopri5", "Radau"):
        atol = case.atol
        # Radau takes one number: the least one is below rounding of velocities in units of hours.
        one = float(np.exp(np.mean(np.log(atol))))
        own |= {"rtol": case.rtol, "atol": one if method == "Radau" else atol}
    else:
        own["dt"] = case.dt
    if method == "Radau":
        own["record"] = ("a", "forces")
    own |= {"max_wall": WALL, **more}
    ends = [0.0, *(case.duration * round(p * case.outputs) / case.outputs for p in case.parts), case.duration]
    runs: list[pn.Trajectory] = []
    for begin, end in pairwise(ends):
        state = (runs[-1].q[-1], runs[-1].v[-1]) if runs else (None, None)
        runs.append(pn.simulate(case.scene, end - begin, *state, t0=case.t0 + begin, **own))
    return runs


def of_run(case: Case, method: str, **more: Any) -> Answer:
    """Return samples on the grid, the end, events and works of a run."""
    runs = simulated(case, method, **more)
    values: dict[str, tuple[str, Any]] = {}
    on = [np.flatnonzero(run.grid)[:: case.finer] for run in runs]
    for run, chosen in zip(runs[:-1], on[:-1], strict=True):  # the end of a part is the start of the next
        assert run.t[chosen[-1]] == run.t[-1]
    on = [*(chosen[:-1] for chosen in on[:-1]), on[-1]]
    pairs = list(zip(runs, on, strict=True))
    values["q"] = ("q", np.concatenate([run.q[chosen] for run, chosen in pairs]))
    values["v"] = ("v", np.concatenate([run.v[chosen] for run, chosen in pairs]))
    values["t"] = ("t", np.concatenate([run.t[chosen] for run, chosen in pairs]))
    sizes = dict(zip(case.scene.element_names, case.scene._compiled.program.element_sizes, strict=True))
    events = [
        (e.time, e.kind, e.element, e.impulse)
        for r in runs
        for e in r.events
        # The reversal of slip with several components is no sharp event.
        if e.kind in EVENTS and (e.kind != "reverse" or sizes.get(e.element) == 1)
    ]
    strongest = max((np.abs(e[3]).max() for e in events if e[3] is not None), default=0.0)
    events = [e for e in events if e[3] is None or np.abs(e[3]).max() > MIN_STRIKE * strongest]
    values["events"] = ("events", events)
    if all(run.energy for run in runs):
        columns = [c for c in runs[0].energy if c not in ("kinetic", "potential", "total", "balance")]
        values["works"] = ("energies", {c: sum(r.energy[c][-1] for r in runs) for c in columns})
    if len(runs) == 1 and runs[0].energy and method in ("dop853", "dopri5"):
        flow = max(np.ptp(runs[0].energy["kinetic"]), np.ptp(runs[0].energy["potential"]))
        values["balance"] = ("balance", (float(np.abs(runs[0].energy["balance"]).max()), float(flow)))
    energies = [run.energy["kinetic"] for run in runs if run.energy]
    largest = max((float(np.max(e)) for e in energies), default=0.0)
    return Answer(values, OF_RUNS, method == "semi_implicit_euler", largest)


for _method in ("dop853", "dopri5", "rk4", "semi_implicit_euler", "moreau", "Radau"):
    function(f"simulate {_method}", run=True)(lambda case, method=_method: of_run(case, method))


@function("stepper", run=True)
def _(case: Case) -> Answer:
    """Compute periods of a control loop with fixed steps."""
    period = case.duration / 10.0
    dt = period / np.ceil(period / case.dt - 1e-6)
    stepper = case.scene.stepper(period, t0=case.t0, method="rk4", dt=dt)
    states = [stepper.step() for _ in range(10)]
    return Answer(
        {"q": ("q", np.array([q for q, _ in states])), "v": ("v", np.array([v for _, v in states]))}, OF_RUNS
    )


@function("poses of a replay", run=True)
def _(case: Case) -> Answer:
    """Compute placements of all joints in ten frames."""
    run = simulated(case, "dop853")[-1]
    motion = sample(run, fps=10.0 / case.duration)
    poses = {name: motion.poses[:, j] for j, name in enumerate(case.model.names) if j}
    return Answer({"poses": ("poses", poses)}, OF_RUNS)


# --- The same -------------------------------------------------------------------------------------------


def asks(name: str, case: Case) -> bool:
    """Check if a function supports a case: implicit methods reject contacts and dry friction."""
    dry = case.contacts or case.has(pn.JointFriction, pn.UserFriction, pn.actuation.SampledControl)
    return name not in case.skips and not (name == "simulate Radau" and dry)


def differences(one: Answer, other: Answer, image: Image, *, sharp: bool = True) -> list[str]:
    """Return the differences between the result of an image, mapped back, and that of its case."""
    if ("error" in one.values) or ("error" in other.values):
        first, second = (a.values.get("error", (0, "an answer"))[1] for a in (one, other))
        same = first.partition(":")[0] == second.partition(":")[0]
        if "EquilibriumError" in second and one.values.get("stable") == ("stable", None):
            return []  # equilibria form a continuum, and the search result is arbitrary
        return [] if same else [f"{first[:200]} | {second[:200]}"]
    found = []
    for name, (kind, value) in one.values.items():
        if name not in other.values:
            found += [f"{name}: missing"] * (kind not in {"balance", "energies", *image.without})
            continue
        said = other.values[name][1]
        if kind != other.values[name][0]:
            found.append(f"{name}: {value} | {said}"[:200])
            continue
        if kind in image.without:
            continue
        if kind == "events" and one.first_order and image.of.contacts:
            continue  # rounding decides the number of short flights
        tolerance = one.tolerance * image.tolerance
        if one.first_order and (image.as_steps_shorten or image.of.contacts):
            tolerance = OF_FIRST_ORDER
        found += [f"{name}: {d}" for d in _differ(kind, value, said, image, tolerance, one.energy)]
    return found


def _differ(
    kind: str, value: Any, said: Any, image: Image, tolerance: float, energy: float = 0.0
) -> list[str]:
    if kind in ("flag", "rank", "stable"):
        return [] if value == said else [f"{value} | {said}"]
    if kind == "balance":
        error, flow = said
        part = error / max(flow, max(energy, MIN_ENERGY) * image.carrier.maps.units.energy)
        allowed = 1e-5 * max(1.0, image.tolerance)
        return [] if part <= allowed else [f"energy balance {part:.1e} of the energy"]
    if kind == "small force":
        return []
    if kind == "power":
        back = said / image.carrier.maps.units.energy * image.carrier.maps.units.T
        return [] if image.moving else _apart(value, back, tolerance, 1.0)
    back = image.back(kind, said)
    if kind in ("q", "place of rest"):
        return _apart_q(image.of.model, value, back, tolerance)
    if kind == "lam":
        if not independent(image.of):
            return []
        size = max((float(np.abs(x).max(initial=0.0)) for x in value.values()), default=0.0)
        return [f"{n} {d}" for n, x in value.items() for d in _apart(x, back[n], tolerance, 1.0 + size)]
    if kind == "poses":
        return [f"{n} {d}" for n, x in value.items() for d in _apart_poses(x, back[n], tolerance)]
    if kind == "by element":
        return [f"{n} {x} | {back.get(n)}" for n, x in value.items() if x != back.get(n)]
    if kind == "energies":
        size = max([*map(abs, value.values()), energy, 1e-2])
        return [f"{n} {d}" for n, x in value.items() for d in _apart(x, back[n], tolerance, size)]
    if kind == "events":
        if coupled(image.of) or coupled(image.case):
            value, back = together(value), together(said_of_all(image, said))
        return _other_events(value, back, 10.0 * tolerance * image.of.duration + image.of.onset)
    return _apart(value, back, tolerance, FLOORS[kind])


def _apart(one: Any, other: Any, tolerance: float, floor: float) -> list[str]:
    one, other = np.asarray(one, dtype=float), np.asarray(other, dtype=float)
    if one.shape != other.shape:
        return [f"shapes {one.shape} | {other.shape}"]
    if not one.size or np.array_equal(one, other):
        return []
    apart = float(np.abs(one - other).max())
    size = max(float(np.abs(one).max()), floor)
    return (
        []
        if apart <= tolerance * size
        else [f"differs by {apart:.2g} of {size:.2g} (allowed {tolerance:.0e})"]
    )


def _apart_q(model: pin.Model, one: Any, other: Any, tolerance: float) -> list[str]:
    one, other = np.atleast_2d(one), np.atleast_2d(other)
    if one.shape != other.shape:
        return [f"shapes {one.shape} | {other.shape}"]
    moves = np.array([pin.difference(model, a, b) for a, b in zip(one, other, strict=True)])
    apart = float(np.abs(moves).max(initial=0.0))
    size = max(1.0, float(np.abs(one).max(initial=0.0)))
    return (
        []
        if apart <= tolerance * size
        else [f"differs by {apart:.2g} of {size:.2g} (allowed {tolerance:.0e})"]
    )


def _apart_poses(one: np.ndarray, other: np.ndarray, tolerance: float) -> list[str]:
    sign = np.sign(np.sum(one[:, 3:] * other[:, 3:], axis=1, keepdims=True))
    return _apart(one, np.hstack([other[:, :3], sign * other[:, 3:]]), tolerance, 1.0)


RUBBING = ("stick", "slip", "reverse")


def coupled(case: Case) -> bool:
    """Check if several friction elements slip together, so that none sticks alone."""
    scene = case.scene
    if len(scene.element_names) < 2 or case.contacts:
        return False
    at = AtRest(scene._compiled, None, case.t0, case.states[0][0])
    slip = at.directions(case.states[0][0])[0] @ at.free(case.states[0][0])
    size = np.linalg.norm(slip, axis=1, keepdims=True)
    slip = slip[size[:, 0] > 0.0] / size[size > 0.0][:, None]
    return bool(len(slip) and np.linalg.matrix_rank(slip, tol=1e-6) < len(slip))


def said_of_all(image: Image, events: list[Any]) -> list[Any]:
    """Return the events of the image, including events of added elements."""
    maps = image.carrier.maps
    return [(maps.time_back(t), kind, element, impulse) for t, kind, element, impulse in events]


def together(events: list[Any]) -> list[Any]:
    """Merge friction events of one time under one name, since rounding decides which element reverses."""
    found: list[Any] = []
    for t, kind, element, impulse in events:
        if kind == "reverse":
            continue
        if kind not in RUBBING:
            found.append((t, kind, element, impulse))
        elif not any(k == kind and abs(t - at) <= 1e-9 for at, k, _, _ in found):
            found.append((t, kind, "", None))
    return found


def _other_events(one: list[Any], other: list[Any], lateness: float) -> list[str]:
    """Compare events by kind and element, with their times and impulses."""

    def key(e: Any) -> Any:
        return (e[1], e[2])

    kinds = sorted({key(e) for e in one} | {key(e) for e in other})
    found = []
    for k in kinds:
        first, second = ([e for e in events if key(e) == k] for events in (one, other))
        if len(first) != len(second):
            found.append(f"{k[0]} of {k[1]}: {len(first)} | {len(second)}")
            continue
        late = max(abs(a[0] - b[0]) for a, b in zip(first, second, strict=True))
        if late > lateness:
            found.append(f"{k[0]} of {k[1]}: {late:.2g} s apart")
    return found
