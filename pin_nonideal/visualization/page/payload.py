"""Data of a replay page: a JSON header and the typed arrays that it refers to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from pin_nonideal.scene.scene import compiled_scene
from pin_nonideal.types import Array, Table

from .applied_forces import applied_force_arrows
from .binary import Payload, Shapes
from .body_overlays import collisions_of, colored_collisions, inertia_box
from .camera import link_length, pattern_spacings, up_direction, view
from .constraint_curves import Guide, guides_of
from .contact_points import contact_point_marks, contact_points
from .contact_surfaces import contact_surfaces, planes_of
from .force_arrows import arrows_of, weight_scales
from .frames import Motion, sample
from .friction_glyphs import elements_of
from .joint_tracks import Tracks
from .markers import constraints_of, marks_of
from .mode_timeline import NamedBands, bands_of, point_bands_of
from .relations import names_relation, stored_relations
from .resampling import resample
from .run_facts import facts_of, subtitle_of
from .signal_list import rounding_of, signals_of, without_rounding
from .signals import Chosen, Plot, default_plot_names, parse_plots, plots_of
from .stick_figure import link_bars
from .stored_items import (
    plain_fields,
    stored_arrow,
    stored_element,
    stored_guide,
    stored_mark,
    stored_plot,
    stored_signal,
)
from .style import table
from .visuals import Visual, joint_axis, visuals_of

if TYPE_CHECKING:
    from pin_nonideal.scene.scene import Scene
    from pin_nonideal.trajectory.trajectory import Trajectory

# Stages of the work on a page, after the motion of each run.
STAGES = ("shapes", "forces", "curves")
# Maximum number of runs with plotted curves; all runs are drawn.
MAX_PLOTTED = 8


def packed_runs(
    runs: Sequence[Trajectory],
    names: Sequence[str],
    fps: float | None,
    title: str,
    plots: Chosen | None,
    forces: bool,
    stage: Callable[[str], object] = len,
) -> bytes:
    """Return the data of a page that shows a run, and other runs as ghosts beside it.

    Args:
        runs: main run, and the runs to compare.
        names: names of the runs.
        fps: frames per second of simulated time; None for frames by the motion.
        title: heading of the page.
        plots: plots, as in `signals.plots_of`.
        forces: whether force arrows and friction cones are shown.
        stage: function that is called with the name of each stage at its begin: "motion" for each run, and
            `STAGES`.
    """
    run, payload = runs[0], Payload()
    scene, compiled = run.scene, compiled_scene(run.scene)
    held, planes = constraints_of(compiled), planes_of(compiled)
    marks, motions = marks_of(compiled, held), []
    for one in runs:
        stage("motion")
        motions.append(sample(one, fps, share=len(runs)))
    model, known = scene.model, [resample(*pair) for pair in zip(runs, motions, strict=True)][:MAX_PLOTTED]
    finer, motion = known[0]
    stage("shapes")
    ends = [(m.joint1, m.point1) for m in marks] + [(m.joint2, m.point2) for m in marks]
    visuals, has_no_shapes = _drawn(scene, motion, ends)
    visuals = visuals + contact_surfaces(finer, motion, visuals, up_direction(model), planes)
    guides = guides_of(finer, motion)
    shapes = Shapes(payload)
    curves = np.vstack([np.zeros((0, 3)), *(guide.points for guide in guides)])
    looking = view(model, motion, visuals, ends, curves, planes)
    drawn = shapes.add(visuals)
    stage("forces")
    touches = contact_points(finer, motion)
    applied = applied_force_arrows(finer, motion, marks) if forces else []
    arrows = arrows_of(finer, motion, touches, applied, held) if forces else []
    for number, spacing in pattern_spacings(motion, visuals, _sliding_axes(model)).items():
        drawn[number]["wrap"] = spacing
    stage("curves")
    items = [] if plots is None else parse_plots("plots", plots)
    chosen = None if plots is None else [item for item in items if not names_relation(run, item)]
    signals = signals_of(run, finer)
    scales = weight_scales(model, motion.size)
    rounding = rounding_of(((signal.unit, signal.values) for signal in signals), scales)
    header = {
        "title": title,
        "subtitle": subtitle_of(run),
        "failure": getattr(run, "failure", None),
        "facts": facts_of(run, motion),
        "looks": table(),
        "times": payload.add(motion.times, "f8"),
        "held": payload.add(motion.held, "u1") if motion.held.any() else None,
        "joints": _joints(payload, model, motion),
        "visuals": drawn,
        "name": names[0],
        "others": [
            _ghost(payload, shapes, *other) for other in zip(runs[1:], motions[1:], names[1:], strict=True)
        ],
        "marks": [
            stored_mark(payload, motion, mark)
            for mark in [*marks, *contact_point_marks(touches, motion, marks)]
        ],
        "guides": [stored_guide(payload, guide) for guide in guides],
        "trails": [{"joint": j, "point": point} for j, point in _trails(model, guides, has_no_shapes)],
        "arrows": [stored_arrow(payload, motion, arrow) for arrow in arrows],
        "plots": _plots(payload, runs, [one for one, _ in known], names, chosen, rounding),
        "events": _events(payload, run),
        "modes": _modes(payload, bands_of(run)) + _modes(payload, point_bands_of(run), point=True),
        "elements": [
            stored_element(payload, motion, element if forces else replace(element, normal=None))
            for element in elements_of(finer, motion, marks, touches)
        ],
        "view": plain_fields(looking),
        "collisions": shapes.add(collisions_of(scene.collision_model)),
        "signals": [stored_signal(payload, signal, rounding) for signal in signals],
        "relations": stored_relations(payload, run, finer, [x for x in items if names_relation(run, x)]),
    }
    header["shapes"] = shapes.stored
    return payload.bytes(header)


def _drawn(scene: Scene, motion: Motion, ends: list[tuple[int, Array]]) -> tuple[list[Visual], bool]:
    """Return the visuals of a scene or else its collision shapes, and whether it has neither."""
    visuals = visuals_of(scene.visual_model) if scene.visual_model is not None else []
    visuals = visuals or colored_collisions(scene.collision_model)
    if visuals:
        return visuals, False
    return link_bars(scene.model, ends, link_length(scene.model, ends, motion.size)), True


def _ghost(payload: Payload, shapes: Shapes, run: Trajectory, motion: Motion, name: str) -> Table:
    """Return a run as a ghost: its motion and its bodies."""
    marks = marks_of(compiled_scene(run.scene))
    ends = [(m.joint1, m.point1) for m in marks] + [(m.joint2, m.point2) for m in marks]
    visuals, _ = _drawn(run.scene, motion, ends)
    return {
        "name": name,
        "times": payload.add(motion.times, "f8"),
        "held": payload.add(motion.held, "u1") if motion.held.any() else None,
        "joints": _joints(payload, run.scene.model, motion),
        "visuals": shapes.add([visual for visual in visuals if visual.joint]),
    }


def _curves(run: Trajectory, finer: Trajectory, chosen: list[Any] | None) -> list[Plot]:
    """Return the plots of a run with interpolated curves; curves of the user have the samples of the run."""
    dense = getattr(run, "dense", None) is not None
    items = default_plot_names(run) if chosen is None else chosen
    smooth = {"q", "v", "energy", "gaps", *run.scene.model.names}  # other curves are linear between samples
    return [
        plot
        for item in items
        for plot in plots_of(finer if isinstance(item, str) and (dense or item in smooth) else run, [item])
    ]


def _plots(
    payload: Payload,
    runs: Sequence[Trajectory],
    finer: Sequence[Trajectory],
    names: Sequence[str],
    items: list[Any] | None,
    rounding: dict[str, float],
) -> list[Table]:
    """Return the plots of the first run, with corresponding curves of the other runs."""
    pairs = zip(runs, finer, strict=False)
    each = [[_without_noise(plot.thinned(), rounding) for plot in _curves(*pair, items)] for pair in pairs]
    plots = []
    for plot in each[0]:
        stored = stored_plot(payload, plot)
        share = f"{len(each)} of {len(runs)} runs" if len(runs) > len(each) else ""
        stored["note"] = " · ".join(filter(None, [plot.note, share]))
        for number, others in enumerate(each[1:], 1):
            for other in others:
                if (other.title, other.unit) == (plot.title, plot.unit):
                    stored["curves"] += _common_curves(payload, plot, other, number, names[number])
        plots.append(stored)
    return plots


def _without_noise(plot: Plot, rounding: dict[str, float]) -> Plot:
    """Return a plot with zero in place of rounding, which only logarithmic axes show."""
    if plot.log:
        return plot
    curve_rounding = rounding_of((plot.unit, values) for values in plot.curves.values())
    level = max(rounding.get(plot.unit, 0.0), curve_rounding.get(plot.unit, 0.0))
    return replace(plot, curves={k: without_rounding(v, level) for k, v in plot.curves.items()})


def _common_curves(payload: Payload, plot: Plot, other: Plot, number: int, name: str) -> list[Table]:
    """Return the curves of another run that the first run also has."""
    t, common = payload.add(other.t, "f8"), {k: v for k, v in other.curves.items() if k in plot.curves}
    return [
        {"label": f"{k}, {name}", "run": number, "of": k, "t": t, "values": payload.curve(v)}
        for k, v in common.items()
    ]


def _sliding_axes(model: pin.Model) -> dict[int, Array]:
    axes = {joint: joint_axis(model, joint) for joint in range(1, model.njoints)}
    return {joint: axis for joint, (axis, turning) in axes.items() if axis is not None and not turning}


def _joints(payload: Payload, model: pin.Model, motion: Motion) -> list[Table]:
    """Return the coordinates of each joint, starting with the world; constant coordinates are stored once."""
    joints: list[Table] = [{"name": str(model.names[0])}]
    for number, track in Tracks(model).moving():
        values = motion.coordinates[:, track.columns]
        still = np.array_equal(values, np.broadcast_to(values[0], values.shape))
        exact = float(np.abs(values).max(initial=0.0)) > 16.0  # larger values need more than 32 bits
        joints.append(
            {
                "name": str(model.names[number]),
                "parent": track.parent,
                "place": track.place.tolist(),
                "axis": None if track.axis is None else track.axis.tolist(),
                "turning": track.turning,
                "mass": float(model.inertias[number].mass),
                "inertia": inertia_box(model.inertias[number]),
                "lever": np.asarray(model.inertias[number].lever).tolist(),
                "values": payload.add(values[:1] if still else values, "f8" if exact else "f4"),
            }
        )
    return joints


def _trails(model: pin.Model, guides: list[Guide], has_no_shapes: bool) -> list[tuple[int, list[float]]]:
    """Return the points with drawn paths: points on guides, and the ends of a model without shapes."""
    trails = {guide.joint: guide.point.tolist() for guide in guides}
    for joint in range(1, model.njoints) if has_no_shapes else ():
        if not len(model.children[joint]):
            trails.setdefault(joint, np.asarray(model.inertias[joint].lever).tolist())
    return list(trails.items())


def _events(payload: Payload, run: Trajectory) -> Table:
    """Return the times of the events with indices of their kinds and elements."""
    kinds = sorted({str(event.kind) for event in run.events})
    elements = sorted({str(event.element) for event in run.events})
    return {
        "kinds": kinds,
        "elements": elements,
        "times": payload.add([float(event.time) for event in run.events], "f8"),
        "kind": payload.add([kinds.index(str(event.kind)) for event in run.events], "u2"),
        "element": payload.add([elements.index(str(event.element)) for event in run.events], "u2"),
        "impulse": payload.add([float(np.linalg.norm(_impulse(event))) for event in run.events]),
        "taken": payload.add([float(getattr(event, "energy_change", 0.0) or 0.0) for event in run.events]),
    }


def _impulse(event: Any) -> Array:
    """Return the impulse of an impact, in the directions of the contact; zero for other events."""
    impulse = getattr(event, "impulse", None)
    return np.zeros(3) if impulse is None else np.asarray(impulse, dtype=float)


def _modes(payload: Payload, bands: NamedBands, point: bool = False) -> list[Table]:
    """Return mode bands: start and mode of each interval, and whether they belong to a point of a contact."""
    timelines = []
    for name, pieces in bands:
        starts, modes = [piece[0] for piece in pieces], [piece[2] for piece in pieces]
        arrays = {"starts": payload.add(starts, "f8"), "modes": payload.add(modes)}
        timelines.append({"name": name, "point": point, **arrays})
    return timelines
