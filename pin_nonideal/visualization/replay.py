"""Replay of a run as one self-contained HTML file, without server, network or installation for the viewer.

The page contains the viewer library of the meshcat package (with three.js), the run as typed arrays, and
scripts. Poses are exact at the frames: at the time of a frame the page shows the placements that Pinocchio
computes for the configuration.
"""

from __future__ import annotations

import base64
import gzip
import html
import importlib.util
import json
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pinocchio as pin

from pin_nonideal.atomic_files import check_writable, file_path, whole_file
from pin_nonideal.errors import InputError, OutputError, short_repr
from pin_nonideal.validation import choice, positive
from pin_nonideal.visualization.page.payload import STAGES, packed_runs
from pin_nonideal.visualization.page.relations import names_relation
from pin_nonideal.visualization.page.signals import Chosen, parse_plots, plots_of, runs_and_names
from pin_nonideal.visualization.page.xy_plots import relations_of
from pin_nonideal.visualization.progress import stages

if TYPE_CHECKING:
    from pin_nonideal.trajectory.trajectory import Trajectory

# Scripts that unpack the other scripts, stored uncompressed.
BOOT = ("payload.js", "main.js")
SCRIPTS = (
    "numbers.js",
    "kinematics.js",
    "ghosts.js",
    "camera.js",
    "shapes.js",
    "instances.js",
    "marks.js",
    "guides.js",
    "arrows.js",
    "elements.js",
    "overlays.js",
    "stage.js",
    "axes.js",
    "plots.js",
    "relations.js",
    "bands.js",
    "timeline.js",
    "table.js",
    "panel.js",
    "url_state.js",
    "capture.js",
    "player.js",
    "api.js",
)
COMPRESSION = 6  # gzip level; 9 takes several times as long and saves a few percent
INLINE_HEIGHT = 640  # height of the page in a notebook [pixels]


@dataclass(frozen=True)
class ReplayPage:
    """Replay that a notebook displays.

    Attributes:
        text: HTML text of the page.
        height: height in the notebook [pixels].
    """

    text: str = field(repr=False)
    height: int = INLINE_HEIGHT

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the page to a file, completely or not at all.

        Args:
            path: path of the file.

        Returns:
            Path of the written file.

        Raises:
            InputError: `path` is not the name of a file.
            OutputError: the file cannot be written.
        """
        target = file_path("replay: path", path)
        with whole_file(target, "the replay") as stream:
            stream.write(self.text.encode())
        return target

    def _repr_html_(self) -> str:
        page = html.escape(self.text, quote=True)
        return f'<iframe srcdoc="{page}" style="width: 100%; height: {self.height}px; border: 0"></iframe>'


def replay(
    run: Trajectory | Sequence[Trajectory],
    path: str | os.PathLike[str] | None = None,
    *,
    names: Sequence[str] | None = None,
    fps: float | None = None,
    title: str | None = None,
    plots: Chosen | None = None,
    compress: bool = True,
    forces: bool = True,
    viewer: Any = None,
    progress: bool | None = None,
) -> Any:
    """Write a run as one HTML file that replays it offline, or show it in a notebook.

    Between the samples of the run the page shows the cubic through q and v of adjacent samples, projected
    onto the constraints.

    Args:
        run: trajectory of `simulate`; record=("forces", "energy") adds arrows and an energy plot. The first
            run of a list is shown, the others as ghosts over it or side by side, on one time axis.
        path: file to write; None for a page that a notebook displays.
        names: names of several runs; None for their numbers.
        fps: frames per second of simulated time; None for frames by the motion, closer together if it is
            fast.
        title: heading of the page; None for the name of the scene.
        plots: names of plots: "energy", "work", "power", "violation", "reactions", "contacts", "gaps", "tau",
            "F_nonideal" (friction in joints), "q", "v", "a", names of joints, or pairs of a title
            "name [unit]" and curves by label, (nt,) each; and of one quantity against another "phase",
            "phase JOINT", "friction", "friction LAW", "load" and "load LAW", as in `plot`. None selects tau
            and F_nonideal of a driven robot, then energy, gaps, violation, reactions and q, if recorded.
        compress: False for a page that also opens in browsers older than 2023, and is three times as large.
        forces: whether the page shows force arrows and friction cones.
        viewer: `meshcat.Visualizer` with an open window. The window receives the robot, the animation and the
            force arrows, and no file is written.
        progress: progress bar on standard error if the page takes longer than a second; None shows it on a
            terminal only.

    Returns:
        Path of the file, or a `ReplayPage`; with `viewer`, Pinocchio's MeshcatVisualizer.

    Raises:
        InputError: fps is not positive, a plot was not recorded, `viewer` is combined with a path or several
            runs, or the run is empty, not finite or without its scene.
        UnknownNameError: a name in `plots` is unknown.
        OutputError: the file cannot be written.
    """
    fps = None if fps is None else positive("replay: fps", fps)
    if title is not None and not isinstance(title, str):
        raise InputError(f"replay: title must be a string or None; got {short_repr(title)}")
    choice("replay: compress", compress, (True, False))
    choice("replay: forces", forces, (True, False))
    choice("replay: progress", progress, (True, False, None))
    target = None if path is None else file_path("replay: path", path)
    runs, labels = runs_and_names(run, names, "a replay")
    if viewer is not None:
        if path is not None or len(runs) > 1:
            raise InputError("replay: viewer takes one run and no path")
        if not all(hasattr(viewer, name) for name in ("window", "set_animation", "__getitem__")):
            raise InputError(f"replay: viewer must be a meshcat.Visualizer; got {short_repr(viewer)}")
        from pin_nonideal.visualization.page.meshcat_window import show

        return show(runs[0], viewer, runs[0].name or "robot", forces)
    if target is not None:
        check_writable(target, "the replay")
    if plots is not None:
        _check_plots(runs, plots)
    viewer_library()
    heading = title or runs[0].name
    with stages(progress, len(runs) + len(STAGES) + 1) as stage:
        packed = packed_runs(runs, labels, fps, heading, plots, forces, stage)
        stage("page")
        page = ReplayPage(_page(packed, heading, compress))
    return page if target is None else page.save(target)


def _check_plots(runs: Sequence[Trajectory], plots: Chosen) -> None:
    """Check the chosen plots before work on the page begins."""
    items = parse_plots("plots", plots)
    relations = [item for item in items if names_relation(runs[0], item)]
    for run in runs:
        plots_of(run, [item for item in items if item not in relations])
    for item in relations:
        relations_of(runs[0], item)


def _page(content: bytes, title: str, compress: bool) -> str:
    """Return the page with the packed runs."""
    library, notices = viewer_library()
    folder = Path(__file__).parent / "page" / "assets"

    def asset(name: str) -> str:
        return (folder / name).read_text(encoding="utf-8")

    parts = {
        "title": html.escape(title),
        "generator": f"pin_nonideal with Pinocchio {pin.__version__}",
        "style": asset("style.css"),
        "notices": html.escape(notices),
        "library": _packed(library, compress),
        "payload": _encode(content, compress),
        "zipped": "true" if compress else "false",
        "boot": "\n".join(asset(name) for name in BOOT),
        "scripts": _packed(
            "\n".join(['"use strict";', *(asset(name) for name in SCRIPTS)]).encode(), compress
        ),
    }
    return re.sub(r"\{\{(\w+)\}\}", lambda match: parts[match.group(1)], asset("page.html"))


def _encode(plain: bytes, compress: bool) -> str:
    """Return bytes in the encoding of the page."""
    return base64.b64encode(gzip.compress(plain, COMPRESSION, mtime=0) if compress else plain).decode()


# The parts that all pages share are compressed once.
_packed = lru_cache(maxsize=4)(_encode)


def viewer_library() -> tuple[bytes, str]:
    """Return meshcat's bundled viewer, found without importing meshcat, and its license notices.

    Raises:
        OutputError: the package meshcat is missing, or its files cannot be read.
    """
    spec = importlib.util.find_spec("meshcat")
    if spec is None or not spec.submodule_search_locations:
        raise OutputError("a replay needs the package meshcat, which is missing: pip install meshcat")
    viewer = Path(spec.submodule_search_locations[0]) / "viewer"
    bundle = viewer / "dist" / "main.min.js"
    try:
        library = bundle.read_bytes()
        license_text = (viewer / "LICENSE").read_text(encoding="utf-8").strip()
        packages = json.loads(Path(f"{bundle}.THIRD_PARTY_LICENSES.json").read_text(encoding="utf-8"))
    except OSError as error:
        raise OutputError(
            f'a replay needs the viewer "{error.filename}", which cannot be read: pip install meshcat==0.3.2'
        ) from error
    texts = [f"meshcat, the viewer of this page\n\n{license_text}"]
    for package in packages:
        heading = f"{package['name']} {package['version']} ({package['license']}), inside meshcat"
        texts.append(f"{heading}\n\n{(package.get('licenseText') or package.get('author') or '').strip()}")
    return library, "\n\n\n".join(texts)
