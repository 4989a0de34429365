"""One self-contained HTML file that replays a run: no server, no network, nothing to install for the viewer.

The page carries the viewer library that the meshcat package ships (three.js inside), the run as typed arrays and
a few scripts of its own.  Poses are exact at the frames: at a frame's time the page shows the placements that
Pinocchio computes from the run's configuration there.
"""

from __future__ import annotations

import base64
import gzip
import html
import importlib.util
import json
import os
import re
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from .checks import positive
from .errors import InputError, OutputError
from .replay_forces import arrows_of, marks_of
from .replay_geometry import Shape, Visual, sticks, visuals_of
from .replay_motion import sample, view
from .replay_signals import mode_bands, plots_of

if TYPE_CHECKING:
    from .trajectory import Trajectory

Array = NDArray[np.float64]

SCRIPTS = ("payload.js", "camera.js", "shapes.js", "scene.js", "plots.js", "timeline.js", "player.js")
COMPRESSION = 6  # gzip level; 9 takes several times as long for a few percent
INLINE_HEIGHT = 640  # height of the page in a notebook [pixels]


@dataclass(frozen=True)
class ReplayPage:
    """A replay that a notebook shows in place.

    Attributes:
        text: the whole page.
        height: height in the notebook [pixels].
    """

    text: str = field(repr=False)
    height: int = INLINE_HEIGHT

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Writes the page to a file, whole or not at all.

        Raises:
            OutputError: the file cannot be written.
        """
        return write_whole(Path(path), self.text)

    def _repr_html_(self) -> str:
        page = html.escape(self.text, quote=True)
        return f'<iframe srcdoc="{page}" style="width: 100%; height: {self.height}px; border: 0"></iframe>'


def replay(
    run: Trajectory,
    path: str | os.PathLike[str] | None = None,
    *,
    fps: float = 60.0,
    title: str | None = None,
    plots: Sequence[str | tuple[str, Mapping[str, Array]]] | None = None,
    compress: bool = True,
    forces: bool = True,
) -> Path | ReplayPage:
    """Writes a run as one HTML file that replays it offline, or shows it in a notebook.

    Between the run's samples the page shows the cubic through their q and v.

    Args:
        run: what `simulate` returned; with record=("forces", "energy") there are arrows and an energy plot.
        path: file to write; None for a page that a notebook shows in place.
        fps: frames of the replay a second of simulated time.
        title: heading of the page; the scene's name when None.
        plots: what is plotted: "energy", "work", "violation", "reactions", "q", "v", "a", names of joints, or
            pairs of a title "what [unit]" and curves by label, (nt,) each. None: energy, violation, reactions
            and q, as far as the run has them.
        compress: False for a page that also opens in browsers older than 2023, three times as large.
        forces: False for a page without arrows of forces.

    Returns:
        The path of the file, or the page.

    Raises:
        InputError: fps is not positive, a plot was not recorded, or the run is empty or not finite.
        UnknownNameError: a name in `plots` is none of the above.
        OutputError: the file cannot be written.
    """
    fps = positive("replay: fps", fps)
    if title is not None and not isinstance(title, str):
        raise InputError(f"replay: title must be a string or None; got {title!r}")
    page = ReplayPage(_page(run, fps, title or run.scene.name, plots, compress, forces))
    return page if path is None else page.save(path)


def write_whole(path: Path, text: str) -> Path:
    """Writes a text file under a temporary name beside it and renames it, so that no half of it is ever seen.

    Raises:
        OutputError: the folder does not exist or cannot be written, or `path` is a folder.
    """
    try:
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name[:40]}.", suffix=".part")
    except OSError as error:
        raise OutputError(_cannot_write(path, error)) from error
    try:
        with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as stream:
            stream.write(text)
        os.chmod(temporary, 0o666 & ~_umask())
        os.replace(temporary, path)
    except BaseException as error:
        Path(temporary).unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise OutputError(_cannot_write(path, error)) from error
        raise
    return path


def _cannot_write(path: Path, error: OSError) -> str:
    return f'cannot write the replay to "{path}": {error.strerror}; name a file in a folder that can be written'


def _umask() -> int:
    """Permissions that new files of this process do not get."""
    mask = os.umask(0)
    os.umask(mask)
    return mask


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

    def bytes(self, header: dict[str, Any]) -> bytes:
        """Length of the header as four bytes, header, arrays."""
        text = json.dumps(header, allow_nan=False, separators=(",", ":")).encode()
        return b"".join([len(text).to_bytes(4, "little"), text, *self._chunks])


def _page(
    run: Trajectory,
    fps: float,
    title: str,
    plots: Sequence[str | tuple[str, Mapping[str, Array]]] | None,
    compress: bool,
    forces: bool,
) -> str:
    """The whole page."""
    library, notices = _viewer_library()
    folder = Path(__file__).parent / "replay_page"

    def packed(content: bytes) -> str:
        return base64.b64encode(gzip.compress(content, COMPRESSION, mtime=0) if compress else content).decode()

    parts = {
        "title": html.escape(title),
        "generator": f"pin_nonideal with Pinocchio {pin.__version__}",
        "style": (folder / "style.css").read_text(encoding="utf-8"),
        "notices": html.escape(notices),
        "library": packed(library),
        "payload": packed(_payload(run, fps, title, plots, forces)),
        "zipped": "true" if compress else "false",
        "scripts": "\n".join((folder / name).read_text(encoding="utf-8") for name in SCRIPTS),
    }
    frame = (folder / "page.html").read_text(encoding="utf-8")
    return re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found.group(1)], frame)


def _viewer_library() -> tuple[bytes, str]:
    """Meshcat's bundled viewer, found without importing meshcat, and the notices that must go with it."""
    found = importlib.util.find_spec("meshcat")
    if found is None or not found.submodule_search_locations:
        raise OutputError("a replay needs the viewer of the meshcat package, which is missing: pip install meshcat")
    viewer = Path(found.submodule_search_locations[0]) / "viewer"
    bundle = viewer / "dist" / "main.min.js"
    try:
        library = bundle.read_bytes()
        texts = ["meshcat (viewer of this page)\n\n" + (viewer / "LICENSE").read_text(encoding="utf-8").strip()]
        packages = json.loads(Path(f"{bundle}.THIRD_PARTY_LICENSES.json").read_text(encoding="utf-8"))
    except OSError as error:
        raise OutputError(
            f'a replay needs the viewer in "{error.filename}", which cannot be read: pip install meshcat==0.3.2'
        ) from error
    for package in packages:
        heading = f"{package['name']} {package['version']} ({package['license']}), inside meshcat"
        texts.append(f"{heading}\n\n{(package.get('licenseText') or package.get('author') or '').strip()}")
    return library, "\n\n\n".join(texts)


def _payload(
    run: Trajectory,
    fps: float,
    title: str,
    plots: Sequence[str | tuple[str, Mapping[str, Array]]] | None,
    forces: bool,
) -> bytes:
    """Everything that the page shows of a run."""
    scene, model, payload = run.scene, run.scene.model, Payload()
    motion = sample(run, fps)
    marks = marks_of(scene)
    ends = [(m.joint1, m.point1) for m in marks] + [(m.joint2, m.point2) for m in marks]
    visuals = visuals_of(scene.visual_model) if scene.visual_model is not None else []
    if not visuals:
        visuals = sticks(model, ends, _skeleton_size(model, scene.q0))
    looking = view(model, motion, visuals, ends)
    shapes, drawn = _shapes(payload, visuals)
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
        "marks": [
            {
                "name": m.name,
                "kind": m.kind,
                "joint1": m.joint1,
                "point1": m.point1.tolist(),
                "joint2": m.joint2,
                "point2": m.point2.tolist(),
            }
            for m in marks
        ],
        "arrows": [
            {
                "name": a.name,
                "kind": a.kind,
                "unit": a.unit,
                "values": payload.add(a.values),
                "origin": None if a.origin is None else payload.add(a.origin),
                "joint": a.joint,
                "axis": None if a.axis is None else a.axis.tolist(),
            }
            for a in (arrows_of(run, motion, marks) if forces else [])
        ],
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
        "view": {
            "up": looking.up.tolist(),
            "direction": looking.direction.tolist(),
            "start": looking.start.tolist(),
            "motion": looking.motion.tolist(),
            "ground": looking.ground,
            "size": looking.size,
            "follow": looking.follow,
        },
    }
    return payload.bytes(header)


def _shortest(poses: Array) -> Array:
    """One pose when a joint never moves, else all."""
    return poses[:1] if np.array_equal(poses, np.broadcast_to(poses[0], poses.shape)) else poses


def _skeleton_size(model: pin.Model, q: Array) -> float:
    """Diagonal of the box around all joints and frames at a configuration [m]."""
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    points = np.array(
        [placement.translation for placement in [*data.oMi, *data.oMf]]
        + [data.oMi[joint].act(model.inertias[joint].lever) for joint in range(1, model.njoints)]
    )
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    return size if size > 1e-6 else 1.0


def _shapes(payload: Payload, visuals: list[Visual]) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Shapes, equal ones once, and the visuals that refer to them by number."""
    known: dict[bytes, int] = {}
    shapes: list[dict[str, Any]] = []
    drawn: list[dict[str, Any]] = []
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


def _stored(payload: Payload, shape: Shape) -> dict[str, Any]:
    stored: dict[str, Any] = {"kind": shape.kind, "size": list(shape.size)}
    if shape.kind == "mesh":
        stored["vertices"] = payload.add(shape.vertices)
        stored["triangles"] = payload.add(shape.triangles, "u2" if len(shape.vertices) <= 0xFFFF else "u4")
        stored["parts"] = [[count, None if color is None else list(color)] for count, color in shape.parts]
    return stored


def _modes(run: Trajectory) -> list[dict[str, Any]]:
    """Bands of the elements that stick or slip, with their names."""
    if run.modes is None or not np.size(run.modes):
        return []
    names = list(getattr(run.scene, "element_names", ()))
    bands = mode_bands(run.t, run.modes)
    names += [f"element {number}" for number in range(len(names), len(bands))]
    return [{"name": name, "runs": runs} for name, runs in zip(names, bands, strict=False)]


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
    stats = run.stats if isinstance(run.stats, Mapping) else vars(run.stats)
    facts += [(str(key), f"{value:g}" if isinstance(value, float) else str(value)) for key, value in stats.items()]
    return [*facts, ("Pinocchio", str(pin.__version__))]
