"""What a replay page carries of a run: one header in JSON and the typed arrays that it refers to."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from pin_nonideal.states.placements import joint_placements
from pin_nonideal.types import Array, Table

from .forces import Arrow, arrows_of, marks_of
from .geometry import Shape, Visual, sticks, visuals_of
from .motion import sample, view
from .signals import Chosen, mode_bands, plots_of

if TYPE_CHECKING:
    from pin_nonideal.trajectory import Trajectory


class Payload:
    """The run as bytes: a JSON header, which refers to the typed arrays that follow it."""

    def __init__(self) -> None:
        self._chunks: list[bytes] = []
        self._length = 0

    def add(self, values: Any, kind: str = "f4") -> dict[str, list[Any]]:
        """Reference to a stored array.

        Args:
            values: anything NumPy can turn into an array; stored flat.
            kind: type of the stored numbers, "f4", "f8", "u2" or "u4".
        """
        chunk = np.ascontiguousarray(values, dtype=f"<{kind}").tobytes()
        reference = {"array": [kind, self._length, len(chunk) // int(kind[1])]}
        self._chunks.append(chunk)
        self._length += len(chunk)
        return reference

    def bytes(self, header: Table) -> bytes:
        """Length of the header as four bytes, header, arrays."""
        text = json.dumps(header, allow_nan=False, separators=(",", ":")).encode()
        return b"".join([len(text).to_bytes(4, "little"), text, *self._chunks])


def packed_run(run: Trajectory, fps: float, title: str, plots: Chosen | None, forces: bool) -> bytes:
    """Everything that the page shows of a run.

    Args:
        run: the run.
        fps: frames a second of simulated time.
        title: heading of the page.
        plots: what is plotted, as `replay_signals.plots_of` takes it.
        forces: whether arrows of forces are shown.
    """
    scene, model, payload = run.scene, run.scene.model, Payload()
    motion = sample(run, fps)
    marks = marks_of(scene)
    ends = [(m.joint1, m.point1) for m in marks] + [(m.joint2, m.point2) for m in marks]
    visuals = visuals_of(scene.visual_model) if scene.visual_model is not None else []
    if not visuals:
        visuals = sticks(model, ends, _skeleton_size(model, scene.q0))
    looking = view(model, motion, visuals, ends)
    shapes, drawn = _shapes(payload, visuals)
    arrows = arrows_of(run, motion, marks) if forces else []
    header = {
        "title": title,
        "subtitle": _subtitle(run),
        "facts": _facts(run, fps),
        "times": payload.add(motion.times, "f8"),
        "joints": [
            {"name": str(name), "poses": payload.add(_shortest(motion.poses[:, joint]))}
            for joint, name in enumerate(model.names)
        ],
        "shapes": shapes,
        "visuals": drawn,
        "marks": [_plain(mark) for mark in marks],
        "arrows": [_stored_arrow(payload, arrow) for arrow in arrows],
        "plots": [
            {
                "title": plot.title,
                "unit": plot.unit,
                "log": plot.log,
                "t": payload.add(plot.t, "f8"),
                "curves": [{"label": k, "values": payload.add(v, "f8")} for k, v in plot.curves.items()],
            }
            for plot in (item.thinned() for item in plots_of(run, plots))
        ],
        "events": [
            {"time": float(e.time), "kind": str(e.kind), "element": str(e.element)} for e in run.events
        ],
        "modes": _modes(run),
        "view": _plain(looking),
    }
    return payload.bytes(header)


def _plain(item: Any) -> Table:
    """The fields of a dataclass, arrays as lists."""
    return {key: v.tolist() if isinstance(v, np.ndarray) else v for key, v in vars(item).items()}


def _stored_arrow(payload: Payload, arrow: Arrow) -> Table:
    stored = _plain(arrow)
    stored["values"] = payload.add(arrow.values)
    if arrow.origin is not None:
        stored["origin"] = payload.add(arrow.origin)
    return stored


def _shortest(poses: Array) -> Array:
    """One pose when a joint never moves, else all."""
    return poses[:1] if np.array_equal(poses, np.broadcast_to(poses[0], poses.shape)) else poses


def _skeleton_size(model: pin.Model, q: Array) -> float:
    """Diagonal of the box around all joints and frames at a configuration [m]."""
    joints = joint_placements(model, q)
    points = np.array(
        [placement.translation for placement in joints]
        + [joints[frame.parentJoint].act(frame.placement.translation) for frame in model.frames]
        + [joints[joint].act(model.inertias[joint].lever) for joint in range(1, model.njoints)]
    )
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    return size if size > 1e-6 else 1.0


def _shapes(payload: Payload, visuals: list[Visual]) -> tuple[list[Table], list[Table]]:
    """Shapes, equal ones once, and the visuals that refer to them by number."""
    known: dict[bytes, int] = {}
    shapes: list[Table] = []
    drawn: list[Table] = []
    for visual in visuals:
        key = _fingerprint(visual.shape)
        if key not in known:
            known[key] = len(shapes)
            shapes.append(_stored(payload, visual.shape))
        drawn.append(
            {
                "name": visual.name,
                "joint": visual.joint,
                "placement": visual.placement.homogeneous.ravel().tolist(),
                "shape": known[key],
                "color": list(visual.color),
            }
        )
    return shapes, drawn


def _fingerprint(shape: Shape) -> bytes:
    """Equal for equal shapes."""
    words = repr((shape.kind, shape.size, shape.parts)).encode()
    return b"|".join([words, shape.vertices.tobytes(), shape.triangles.tobytes()])


def _stored(payload: Payload, shape: Shape) -> Table:
    stored: Table = {"kind": shape.kind, "size": list(shape.size)}
    if shape.kind == "mesh":
        stored["vertices"] = payload.add(shape.vertices)
        stored["triangles"] = payload.add(shape.triangles, "u2" if len(shape.vertices) <= 0xFFFF else "u4")
        stored["parts"] = [[count, None if color is None else list(color)] for count, color in shape.parts]
    return stored


def _modes(run: Trajectory) -> list[Table]:
    """Bands of the elements that stick or slip, with their names."""
    if run.modes is None:
        return []
    pairs = zip(run.element_names, mode_bands(run.t, run.modes), strict=True)
    return [{"name": name, "runs": runs} for name, runs in pairs]


def _subtitle(run: Trajectory) -> str:
    model = run.scene.model
    count = len(run.scene.constraint_slices)
    words = [_counted(model.njoints - 1, "joint"), _counted(count, "constraint")]
    if count:
        words.append(f"violation below {_above(float(np.max(run.violation)))}")
    return " · ".join(words)


def _counted(count: int, word: str) -> str:
    return f"{count or 'no'} {word}{'' if count == 1 else 's'}"


def _above(value: float) -> str:
    """A value rounded up to two digits."""
    if not value > 0.0:
        return "1e-16"
    power = 10.0 ** (np.floor(np.log10(value)) - 1.0)
    return f"{np.ceil(value / power) * power:.1e}"


def _facts(run: Trajectory, fps: float) -> list[tuple[str, str]]:
    """What the help dialog tells of a run."""
    model = run.scene.model
    facts = [
        ("scene", str(run.scene.name)),
        ("model", f"{model.name}, {model.njoints - 1} joints, nq {model.nq}, nv {model.nv}"),
        ("time", f"{run.t[0]:g} to {run.t[-1]:g} s, {len(run.t)} samples, {fps:g} frames a second"),
    ]
    for key, value in vars(run.stats).items():
        facts.append((str(key), f"{value:g}" if isinstance(value, float) else str(value)))
    return [*facts, ("Pinocchio", str(pin.__version__))]
