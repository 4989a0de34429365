"""One self-contained HTML file that replays a run: no server, no network, nothing to install for the viewer.

The page carries the viewer library that the meshcat package ships (three.js inside), the run as typed arrays
and a few scripts of its own.  Poses are exact at the frames: at a frame's time the page shows the placements
that Pinocchio computes from the run's configuration there.
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
from pin_nonideal.visualization.page.relations import is_asked
from pin_nonideal.visualization.page.signals import Chosen, plots_of, several, wanted
from pin_nonideal.visualization.page.xy_plots import relations_of
from pin_nonideal.visualization.progress import stages

if TYPE_CHECKING:
    from pin_nonideal.trajectory.trajectory import Trajectory

# What unpacks the others is read by the browser as it is.
BOOT = ("payload.js", "boot.js")
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
    "address.js",
    "capture.js",
    "player.js",
    "door.js",
)
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

        Args:
            path: the file.

        Returns:
            The path written.

        Raises:
            InputError: `path` is no name of a file.
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
    """Writes a run as one HTML file that replays it offline, or shows it in a notebook.

    Between the run's samples the page shows the cubic through their q and v, its loops closed.

    Args:
        run: what `simulate` returned; with record=("forces", "energy") there are arrows and an energy plot.
            Of a list the first is shown, and the others as ghosts over it or side by side, on one time line.
        path: file to write; None for a page that a notebook shows in place.
        names: names of several runs; their numbers when None.
        fps: frames of the replay a second of simulated time; None for frames that follow the motion, close
            together where it is fast.
        title: heading of the page; the scene's name when None.
        plots: what is plotted: "energy", "work", "power", "violation", "reactions", "contacts", "gaps",
            "tau", "F_nonideal" (friction in joints), "q", "v", "a", names of joints, or pairs of a title
            "what [unit]" and curves by label, (nt,) each; of one quantity over another "phase",
            "phase JOINT", "friction", "friction LAW", "load" and "load LAW", as for `plot`. None: of a driven
            robot tau and F_nonideal, then energy, gaps, violation, reactions and q, as far as recorded.
        compress: False for a page that also opens in browsers older than 2023, three times as large.
        forces: False for a page without arrows of forces.
        viewer: a `meshcat.Visualizer` whose window is open: it is filled with robot, animation and arrows of
            forces, and nothing is written.
        progress: progress bar on standard error where the page takes longer than a second; None shows it on a
            terminal only.

    Returns:
        The path of the file, or the page, a `ReplayPage`; with `viewer` Pinocchio's MeshcatVisualizer.

    Raises:
        InputError: fps is not positive, a plot was not recorded, `viewer` comes with a path or several runs,
            or the run is empty, not finite or without its scene.
        UnknownNameError: a name in `plots` is none of the above.
        OutputError: the file cannot be written.
    """
    fps = None if fps is None else positive("replay: fps", fps)
    if title is not None and not isinstance(title, str):
        raise InputError(f"replay: title must be a string or None; got {short_repr(title)}")
    choice("replay: compress", compress, (True, False))
    choice("replay: forces", forces, (True, False))
    choice("replay: progress", progress, (True, False, None))
    target = None if path is None else file_path("replay: path", path)
    runs, labels = several(run, names, "a replay")
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
    items = wanted("plots", plots)
    relations = [item for item in items if is_asked(runs[0], item)]
    for run in runs:
        plots_of(run, [item for item in items if item not in relations])
    for item in relations:
        relations_of(runs[0], item)


def _page(content: bytes, title: str, compress: bool) -> str:
    """The whole page around the packed runs."""
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
        "payload": _stored(content, compress),
        "zipped": "true" if compress else "false",
        "boot": "\n".join(asset(name) for name in BOOT),
        "scripts": _packed(
            "\n".join(['"use strict";', *(asset(name) for name in SCRIPTS)]).encode(), compress
        ),
    }
    return re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found.group(1)], asset("page.html"))


def _stored(plain: bytes, compress: bool) -> str:
    """Return bytes in the encoding of the page."""
    return base64.b64encode(gzip.compress(plain, COMPRESSION, mtime=0) if compress else plain).decode()


# The parts that all pages share are compressed once.
_packed = lru_cache(maxsize=4)(_stored)


def viewer_library() -> tuple[bytes, str]:
    """Return meshcat's bundled viewer, found without importing meshcat, and its license notices.

    Raises:
        OutputError: the package meshcat is missing, or its files cannot be read.
    """
    found = importlib.util.find_spec("meshcat")
    if found is None or not found.submodule_search_locations:
        raise OutputError("a replay needs the package meshcat, which is missing: pip install meshcat")
    viewer = Path(found.submodule_search_locations[0]) / "viewer"
    bundle = viewer / "dist" / "main.min.js"
    try:
        library = bundle.read_bytes()
        own = (viewer / "LICENSE").read_text(encoding="utf-8").strip()
        packages = json.loads(Path(f"{bundle}.THIRD_PARTY_LICENSES.json").read_text(encoding="utf-8"))
    except OSError as error:
        raise OutputError(
            f'a replay needs the viewer "{error.filename}", which cannot be read: pip install meshcat==0.3.2'
        ) from error
    texts = [f"meshcat, the viewer of this page\n\n{own}"]
    for package in packages:
        heading = f"{package['name']} {package['version']} ({package['license']}), inside meshcat"
        texts.append(f"{heading}\n\n{(package.get('licenseText') or package.get('author') or '').strip()}")
    return library, "\n\n\n".join(texts)
