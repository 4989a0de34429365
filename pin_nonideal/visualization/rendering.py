"""Pictures and videos of a replay from the command line, drawn by a headless browser."""

from __future__ import annotations

import asyncio
import base64
import io
import json
import os
import shutil
import subprocess
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from pin_nonideal.atomic_files import check_writable, file_path, whole_file
from pin_nonideal.errors import InputError, OutputError
from pin_nonideal.trajectory.trajectory import Trajectory
from pin_nonideal.validation import choice, count, number, positive

from .headless_browser import open_page
from .replay import ReplayPage, replay

ENDINGS = (".png", ".gif", ".webm", ".mp4")
CODECS = {
    ".mp4": ["-c:v", "libx264", "-preset", "veryfast", "-movflags", "+faststart"],
    ".webm": ["-c:v", "libvpx-vp9", "-deadline", "realtime", "-cpu-used", "6", "-crf", "30", "-b:v", "0"],
}
# Color space that players assume for files without one: BT.709, with black at 16 and white at 235.
COLORS = ["-vf", "scale=out_range=tv:out_color_matrix=bt709", "-pix_fmt", "yuv420p", "-color_range", "tv"]
COLORS += ["-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "bt709"]
# maximum side in browsers [pixels]; one hour at 25 pictures per second
MAX_SIDE, MAX_PICTURES = 16384, 100_000
MIN_FPS = 0.01  # limit of the GIF format
MAX_PIXELS_AT_ONCE = 8_000_000  # maximum number of pixels of the pictures in one request to the browser
# Hides everything on the page except the view, which fills the window.
HIDE_CONTROLS = """(() => {
  const style = document.createElement("style");
  style.textContent = "#dock, #tools, #forces, #heading { display: none !important }"
    + "#stage { min-height: 0 }";
  document.head.append(style);
})()"""


def render(
    run: Trajectory,
    path: str | os.PathLike[str],
    *,
    width: int = 960,
    height: int = 540,
    seconds: float = 6.0,
    fps: float = 25.0,
    time: float | None = None,
    forces: bool = True,
) -> Path:
    """Render the replay of a run to a picture or a video, with an installed Chromium or Chrome.

    Args:
        run: trajectory of `simulate`.
        path: file to write: .png, .gif, .webm or .mp4, the last two by ffmpeg.
        width: width of the picture [pixels].
        height: height of the picture [pixels].
        seconds: duration of a video, which shows the whole run [s].
        fps: pictures per second of a video.
        time: time of a single picture [s]; None for a quarter of the run.
        forces: whether force arrows and friction cones are shown.

    Returns:
        Path of the written file.

    Raises:
        InputError: the size, the duration or the rate is not positive, or the run cannot be replayed.
        OutputError: the suffix is not supported, no browser or no ffmpeg is found, or the file cannot be
            written.
    """
    if not isinstance(run, Trajectory):
        raise InputError(f"render: run must be a Trajectory; got {type(run).__name__}")
    target = file_path("render: path", path)
    ending = target.suffix.lower()
    if ending not in ENDINGS:
        raise OutputError(f'render: "{target}" must end in one of {", ".join(ENDINGS)}')
    check_writable(target, "the picture")
    size = [
        count(f"render: {what}", x, min_value=1, max_value=MAX_SIDE)
        for what, x in (("width", width), ("height", height))
    ]
    seconds, fps = positive("render: seconds", seconds), positive("render: fps", fps)
    encoder = _ffmpeg(ending) if ending in CODECS else ""
    if not len(run):
        raise InputError("render: run must have samples; got an empty one")
    start, length = float(run.t[0]), float(run.t[-1] - run.t[0])
    if time is not None and not start <= number("render: time", time) <= start + length:
        raise InputError(
            f"render: time must lie in the run, from {start:g} to {start + length:g} s; got {time:g}"
        )
    choice("render: forces", forces, (True, False))
    if fps < MIN_FPS:
        raise InputError(f"render: fps must be at least {MIN_FPS}; got {fps:g}")
    if seconds * fps > MAX_PICTURES:
        raise InputError(
            f"render: seconds times fps must be at most {MAX_PICTURES} pictures; got {seconds * fps:g}"
        )
    frames = max(2, round(seconds * fps))
    times = [start + length * k / (frames - 1) for k in range(frames)]
    if ending == ".png":
        times = [start + 0.25 * length if time is None else float(time)]
    if ending in CODECS:
        size = [x + x % 2 for x in size]  # both codecs halve the color resolution
    page: ReplayPage = replay(run, forces=forces)
    kind = "image/png" if ending in (".png", ".gif") else "image/jpeg"
    with ThreadPoolExecutor(max_workers=1) as thread:  # a notebook runs an event loop in this thread
        pictures = thread.submit(asyncio.run, _pictures(page.text, size, times, kind)).result()
    if ending in CODECS:
        content = _video(pictures, ending, fps, encoder)
    else:
        content = pictures[0] if ending == ".png" else _gif(pictures, fps)
    with whole_file(target, "the picture") as stream:
        stream.write(content)
    return target


async def _pictures(text: str, size: list[int], times: list[float], kind: str) -> list[bytes]:
    """Return pictures of the view of a page at some times, as files of the given kind."""
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "replay.html"
        page.write_text(text, encoding="utf-8")
        async with open_page(Path(folder), page.as_uri() + "#paused", size) as ask:
            await ask(HIDE_CONTROLS)
            await ask("new Promise((done) => setTimeout(done, 200))")
            await ask("(replay.showForces(true), replay.resetView())")  # small pages start without arrows
            return [
                base64.b64decode(one)
                for part in _parts(times, size)
                for one in await ask(f"replay.pictures({json.dumps(kind)}, {json.dumps(part)})")
            ]


def _parts(times: list[float], size: list[int]) -> list[list[float]]:
    """Return groups of times whose pictures are requested together, because the page is blocked meanwhile."""
    together = max(1, MAX_PIXELS_AT_ONCE // (size[0] * size[1]))
    return [times[k : k + together] for k in range(0, len(times), together)]


def _gif(pictures: list[bytes], fps: float) -> bytes:
    """Return pictures as an animated GIF."""
    from PIL import Image

    frames = [Image.open(io.BytesIO(one)).convert("P", palette=Image.Palette.ADAPTIVE) for one in pictures]
    out = io.BytesIO()
    frames[0].save(
        out, "GIF", save_all=True, append_images=frames[1:], duration=1000.0 / fps, loop=0, optimize=True
    )
    return out.getvalue()


def _ffmpeg(ending: str) -> str:
    """Return the path of ffmpeg, or of the executable in imageio-ffmpeg."""
    encoder = shutil.which("ffmpeg")
    if encoder is None:
        try:
            from imageio_ffmpeg import get_ffmpeg_exe

            encoder = get_ffmpeg_exe()
        except (ImportError, RuntimeError):
            raise OutputError(
                f"render: {ending} needs ffmpeg on the path, or pip install 'pin-nonideal[video]'; "
                "or write .gif instead"
            ) from None
    return str(encoder)


def _video(pictures: list[bytes], ending: str, fps: float, encoder: str) -> bytes:
    """Return pictures as a video, encoded by ffmpeg."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"video{ending}"
        read = ["-y", "-loglevel", "error", "-f", "image2pipe", "-framerate", f"{fps:g}", "-i", "-"]
        command = [encoder, *read, *CODECS[ending], *COLORS, str(path)]
        process = subprocess.run(command, input=b"".join(pictures), capture_output=True, check=False)
        if process.returncode:
            raise OutputError(
                f"render: ffmpeg failed: {process.stderr.decode(errors='replace').strip()[-300:]}"
            )
        return path.read_bytes()
