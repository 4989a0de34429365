"""What the core hands over as a Trajectory; what stopped the run as an exception that holds it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pin_nonideal.compilation.failures import opened
from pin_nonideal.core import core
from pin_nonideal.errors import LoopClosureError, OutputError, RunError, RunInterrupted, UserFunctionError
from pin_nonideal.scene import Scene
from pin_nonideal.states.rows import rows_at
from pin_nonideal.trajectory import LEDGER, Event, Stats, Trajectory
from pin_nonideal.types import Array, Table

from .options import RunOptions

# A sample with a larger gap than this [m or rad] has left the constraints: after every step projection comes
# down to rounding, and in singular positions to the square root of it.
LEFT = 1e-6
KEPT = "the trajectory up to there is in error.trajectory"


def finish(
    scene: Scene, outcome: core.Outcome, stopped: BaseException | None, options: RunOptions, wall: float
) -> Trajectory:
    """The trajectory of a run; raises what stopped it, with the trajectory attached.

    Args:
        scene: the scene that ran.
        outcome: of the core.
        stopped: a failure of the core, what a function of the user raised, an interrupt, or None.
        options: what was asked for.
        wall: wall time [s].

    Raises:
        RunError: the run stopped early.
        OutputError: its first checkpoint could not be written.
    """
    trajectory = shaped(scene, outcome, options, wall)
    if outcome.largest_violation > LEFT and (stopped is None or isinstance(stopped, core.CoreFailure)):
        raise _opened(scene, trajectory)
    if stopped is None:
        return trajectory
    if isinstance(stopped, OutputError):
        raise stopped
    last = float(trajectory.t[-1]) if len(trajectory) else options.t0
    cause: BaseException | None = None
    if isinstance(stopped, core.CoreFailure):
        error = scene._compiled.named(stopped)
        error.args = (f"{error}; {KEPT}", *error.args[1:])
    elif isinstance(stopped, KeyboardInterrupt):
        error = RunInterrupted(f"the run was interrupted at t = {last:.4g} s; {KEPT}", time=last)
    elif isinstance(stopped, RunError):
        error, cause = stopped, stopped.__cause__
    else:
        error = UserFunctionError(f"a function of the scene failed at t = {last:.4g} s: {stopped}", time=last)
        cause = stopped
    error.time = last if error.time is None else error.time
    error.trajectory = trajectory
    raise error from cause


def _opened(scene: Scene, trajectory: Trajectory) -> LoopClosureError:
    """A run has left its constraints, as it must when a drive pulls a loop apart; with the samples before."""
    k = int((trajectory.violation > LEFT).argmax())
    t = float(trajectory.t[k])
    runner = scene._compiled.program.runner()
    residual = np.abs(rows_at(runner, trajectory.q[k], trajectory.v[k], t)[2])
    gaps = {key: float(residual[rows].max()) for key, rows in scene.constraint_slices.items()}
    stopped = opened(max(gaps, key=lambda key: gaps[key]), gaps, t, f"; {KEPT}")
    stopped.trajectory = trajectory.first(k)
    return stopped


def shaped(scene: Scene, outcome: core.Outcome, options: RunOptions, wall: float) -> Trajectory:
    """A Trajectory from the core's flat arrays.

    Args:
        scene: the scene that ran.
        outcome: of the core.
        options: what was asked for.
        wall: wall time [s].
    """
    t, nq, nv, program = outcome.t, scene.q0.size, scene.v0.size, scene._compiled.program
    nt = len(t)
    fields: Table = {}
    if options.a:
        fields["a"] = outcome.a.reshape(nt, nv)
    if options.forces:
        fields["F_ideal"] = outcome.F_ideal.reshape(nt, nv)
        fields["F_nonideal"] = outcome.F_nonideal.reshape(nt, nv)
        fields["lam"] = outcome.lam.reshape(nt, program.rows)
        fields["lam_ideal"] = outcome.lam_ideal.reshape(nt, program.rows)
    if options.laws:
        fields |= _of_laws(scene, outcome)
    if options.reactions:
        fields["reactions"] = _reactions(scene, outcome)
    if options.power or options.energy:
        columns = _columns(program)
    if options.power:
        power = outcome.power.reshape(nt, len(columns))
        fields["power"] = dict(zip(columns, power.T, strict=True))
    if options.energy:
        fields["energy"] = _ledger(columns, outcome.energy)
    if program.states:
        fields["z"] = outcome.z.reshape(nt, program.states)
    elements = scene.element_names
    if elements:
        fields["modes"] = outcome.modes.reshape(nt, len(elements))
    return Trajectory(
        t=t,
        q=outcome.q.reshape(nt, nq),
        v=outcome.v.reshape(nt, nv),
        violation=outcome.violation,
        violation_rate=outcome.violation_rate,
        events=[_event(scene, event) for event in outcome.events],
        stats=Stats(
            outcome.steps,
            outcome.rejected,
            outcome.evaluations,
            outcome.factorizations,
            outcome.projections,
            outcome.iterations,
            wall,
        ),
        scene=scene,
        element_names=list(elements),
        element_laws=list(program.element_laws),
        law_names=list(program.law_names),
        name=scene.name,
        **fields,
    )


def _of_laws(scene: Scene, outcome: core.Outcome) -> Table:
    """Forces of the laws on the degrees of freedom that each acts on, and limits of the elements."""
    program, nt = scene._compiled.program, len(outcome.t)
    supports = program.law_supports
    ends = np.cumsum([len(dofs) for dofs in supports])
    parts = np.split(outcome.law_forces.reshape(nt, int(ends[-1]) if len(ends) else 0), ends[:-1], axis=1)
    elements = len(scene.element_names)
    return {
        "law_forces": dict(zip(program.law_names, parts, strict=False)),
        "law_dofs": [list(dofs) for dofs in supports],
        "limits": outcome.limits.reshape(nt, elements) if elements else None,
    }


def _reactions(scene: Scene, outcome: core.Outcome) -> dict[str, Array]:
    """Wrenches of joints, then of anchors and contacts, in their own axes and in world axes."""
    program = scene._compiled.program
    joints = [str(name) for name in scene.model.names][1:]
    names = [*joints, *(program.constraints[block].name for block in program.reaction_blocks)]
    wrenches = outcome.reactions.reshape(len(outcome.t), len(names), 12)
    return {name: wrenches[:, k] for k, name in enumerate(names)}


def _event(scene: Scene, event: core.Event) -> Event:
    """An event with the name of its frictional element, or of the contact that pulls."""
    names = list(scene.constraint_slices) if event.kind is core.EventKind.pull else scene.element_names
    return Event(event.time, event.kind.name, names[event.element])


def _ledger(columns: Sequence[str], energy: Array) -> dict[str, Array]:
    """The core's columns of energy, stored and done since the start, and their sums."""
    stored, done = ("kinetic", "potential"), (*columns, "projection")
    split = len(stored)
    numbers = energy.reshape(-1, split + len(done))
    ledger = dict(zip(stored, numbers.T[:split], strict=True))
    ledger["total"] = ledger["kinetic"] + ledger["potential"]
    ledger |= dict(zip(done, numbers.T[split:], strict=True))
    ledger["balance"] = ledger["total"] - ledger["total"][:1] - numbers[:, split:].sum(axis=1)
    return ledger


def _columns(program: core.Program) -> list[str]:
    """Columns of power, with laws under names that no other column of a ledger bears."""
    names = program.power_names
    first_law = len(names) - len(program.law_names)
    taken = {*LEDGER, *names[:first_law], "projection"}
    return names[:first_law] + [f"law {name}" if name in taken else name for name in names[first_law:]]
