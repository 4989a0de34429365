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
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import pinocchio as pin

from .checks import choice, positive
from .errors import InputError, OutputError
from .files import file_path, whole_file
from .page.payload import packed_run
from .page.signals import Chosen, check_scene

if TYPE_CHECKING:
    from .trajectory import Trajectory

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
    run: Trajectory,
    path: str | os.PathLike[str] | None = None,
    *,
    fps: float = 60.0,
    title: str | None = None,
    plots: Chosen | None = None,
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
        InputError: fps is not positive, a plot was not recorded, or the run is empty, not finite or
            without its scene.
        UnknownNameError: a name in `plots` is none of the above.
        OutputError: the file cannot be written.
    """
    fps = positive("replay: fps", fps)
    if title is not None and not isinstance(title, str):
        raise InputError(f"replay: title must be a string or None; got {title!r}")
    choice("replay: compress", compress, (True, False))
    choice("replay: forces", forces, (True, False))
    check_scene(run, "a replay")
    page = ReplayPage(_page(run, fps, title or run.name, plots, compress, forces))
    return page if path is None else page.save(path)


def _page(
    run: Trajectory,
    fps: float,
    title: str,
    plots: Chosen | None,
    compress: bool,
    forces: bool,
) -> str:
    """The whole page."""
    library, notices = _viewer_library()
    folder = Path(__file__).parent / "page" / "assets"

    def packed(content: bytes) -> str:
        stored = gzip.compress(content, COMPRESSION, mtime=0) if compress else content
        return base64.b64encode(stored).decode()

    parts = {
        "title": html.escape(title),
        "generator": f"pin_nonideal with Pinocchio {pin.__version__}",
        "style": (folder / "style.css").read_text(encoding="utf-8"),
        "notices": html.escape(notices),
        "library": packed(library),
        "payload": packed(packed_run(run, fps, title, plots, forces)),
        "zipped": "true" if compress else "false",
        "scripts": "\n".join((folder / name).read_text(encoding="utf-8") for name in SCRIPTS),
    }
    frame = (folder / "page.html").read_text(encoding="utf-8")
    return re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found.group(1)], frame)


def _viewer_library() -> tuple[bytes, str]:
    """Meshcat's bundled viewer, found without importing meshcat, and the notices that must go with it."""
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
