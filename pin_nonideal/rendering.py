"""Pictures and videos of a replay from the command line: its page in a browser without a window."""

from __future__ import annotations

import asyncio
import base64
import io
import itertools
import json
import os
import shutil
import subprocess
import tempfile
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from .checks import count, number, positive
from .errors import InputError, OutputError
from .files import file_path, whole_file
from .replaying import ReplayPage, replay
from .trajectory import Trajectory

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "msedge")
ENDINGS = (".png", ".gif", ".webm", ".mp4")
FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--hide-scrollbars",
    "--mute-audio",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--remote-debugging-port=0",
)
LARGEST, MOST_PICTURES = 16384, 100_000  # pixels of a side that browsers draw; an hour at 25 a second
LEAST_FPS = 0.01  # a GIF knows no longer picture
READY = 60.0  # until the browser listens and the page is drawn [s]
# Leaves the view alone on the page, as large as the window.
ALONE = """(() => {
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
    """Renders the replay of a run to a picture or a video, with a Chromium or Chrome of the machine.

    Args:
        run: what `simulate` returned.
        path: file to write: .png, .gif, .webm, or .mp4, which takes ffmpeg.
        width: of the picture [pixels].
        height: of the picture [pixels].
        seconds: length of a video, in which the whole run is played [s].
        fps: pictures a second of a video.
        time: of a single picture [s]; a quarter of the run when None.
        forces: False for a view without arrows.

    Returns:
        The path written.

    Raises:
        InputError: the size, the length or the rate is not positive, or the run cannot be replayed.
        OutputError: the ending is none of these, no browser or no ffmpeg is found, or the file cannot be
            written.
    """
    if not isinstance(run, Trajectory):
        raise InputError(f"render: run must be a Trajectory; got {type(run).__name__}")
    target = file_path("render: path", path)
    ending = target.suffix.lower()
    if ending not in ENDINGS:
        raise OutputError(f'render: "{target}" must end in one of {", ".join(ENDINGS)}')
    size = [
        count(f"render: {what}", x, least=1, most=LARGEST)
        for what, x in (("width", width), ("height", height))
    ]
    seconds, fps = positive("render: seconds", seconds), positive("render: fps", fps)
    encoder = shutil.which("ffmpeg")
    if ending == ".mp4" and encoder is None:
        raise OutputError("render: .mp4 needs ffmpeg, which is not on the path; write .webm or .gif instead")
    start, length = float(run.t[0]), float(run.t[-1] - run.t[0])
    if fps < LEAST_FPS:
        raise InputError(f"render: fps must be at least {LEAST_FPS}; got {fps:g}")
    if seconds * fps > MOST_PICTURES:
        raise InputError(
            f"render: seconds times fps must be at most {MOST_PICTURES} pictures; got {seconds * fps:g}"
        )
    frames = max(2, round(seconds * fps))
    times = [start + length * k / (frames - 1) for k in range(frames)]
    if ending == ".png":
        times = [start + 0.25 * length if time is None else number("render: time", time)]
    page: ReplayPage = replay(run, forces=forces)
    kind = "image/png" if ending in (".png", ".gif") else "image/jpeg"
    pictures = asyncio.run(_pictures(page.text, size, times, kind))
    with whole_file(target, "the picture") as stream:
        stream.write(_encoded(pictures, ending, fps, encoder))
    return target


def _encoded(pictures: list[bytes], ending: str, fps: float, encoder: str | None) -> bytes:
    """Pictures as one file."""
    if ending == ".png":
        return pictures[0]
    if ending == ".gif":
        from PIL import Image

        frames = [
            Image.open(io.BytesIO(one)).convert("P", palette=Image.Palette.ADAPTIVE) for one in pictures
        ]
        out = io.BytesIO()
        frames[0].save(
            out, "GIF", save_all=True, append_images=frames[1:], duration=1000.0 / fps, loop=0, optimize=True
        )
        return out.getvalue()
    if encoder is None:
        raise OutputError("render: .webm needs ffmpeg, which is not on the path; write .gif instead")
    with tempfile.TemporaryDirectory() as folder:
        out_file = Path(folder) / f"video{ending}"
        command = [
            encoder,
            "-y",
            "-loglevel",
            "error",
            "-f",
            "image2pipe",
            "-framerate",
            f"{fps:g}",
            "-i",
            "-",
        ]
        command += ["-pix_fmt", "yuv420p", "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", str(out_file)]
        done = subprocess.run(command, input=b"".join(pictures), capture_output=True, check=False)
        if done.returncode:
            raise OutputError(f"render: ffmpeg failed: {done.stderr.decode(errors='replace').strip()[-300:]}")
        return out_file.read_bytes()


async def _pictures(text: str, size: list[int], times: list[float], kind: str) -> list[bytes]:
    """The view at some times, encoded."""
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "replay.html"
        page.write_text(text, encoding="utf-8")
        async with _opened(Path(folder), page.as_uri() + "#paused", size) as ask:
            await ask(ALONE)
            await ask("new Promise((done) => setTimeout(done, 200))")
            await ask("(replay.showForces(true), replay.resetView())")  # small pages begin without arrows
            found = []
            for moment in times:
                picture = await ask(f"replay.picture({json.dumps(kind)}, {moment!r})")
                found.append(base64.b64decode(picture))
            return found


@asynccontextmanager
async def _opened(folder: Path, address: str, size: list[int]) -> AsyncIterator[Any]:
    """A page in a browser without a window, as a function that evaluates expressions there."""
    from tornado.websocket import websocket_connect

    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        known = ", ".join(BROWSERS[:3])
        raise OutputError(f"render needs a browser on the path: {known}; none is there")
    profile = folder / "profile"
    command = [
        browser,
        *FLAGS,
        f"--window-size={size[0]},{size[1]}",
        f"--user-data-dir={profile}",
        "about:blank",
    ]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        port, door = await _listening(profile / "DevToolsActivePort", process)
        socket = await websocket_connect(f"ws://127.0.0.1:{port}{door}", max_message_size=1 << 28)
        numbers = itertools.count(1)

        async def call(method: str, session: str | None = None, **values: Any) -> Any:
            number = next(numbers)
            message = {"id": number, "method": method, "params": values}
            await socket.write_message(json.dumps(message | ({"sessionId": session} if session else {})))
            while True:
                answer = await asyncio.wait_for(socket.read_message(), READY)
                if answer is None:
                    raise OutputError("render: the browser closed its connection")
                heard = json.loads(answer)
                if heard.get("id") == number:
                    return heard.get("result", {})

        target = (await call("Target.createTarget", url="about:blank"))["targetId"]
        session = (await call("Target.attachToTarget", targetId=target, flatten=True))["sessionId"]
        metrics = {"width": size[0], "height": size[1], "deviceScaleFactor": 1, "mobile": False}
        await call("Emulation.setDeviceMetricsOverride", session, **metrics)
        await call("Page.navigate", session, url=address)

        async def ask(expression: str) -> Any:
            values = {"expression": expression, "awaitPromise": True, "returnByValue": True}
            answer = await call("Runtime.evaluate", session, **values)
            if "exceptionDetails" in answer:
                raise OutputError(f"render: {answer['exceptionDetails'].get('text')}: {expression[:60]}")
            return answer.get("result", {}).get("value")

        for _ in range(int(READY / 0.1)):
            if await ask("Boolean(window.replayDone || window.replayError)"):
                break
            await asyncio.sleep(0.1)
        failure = await ask("window.replayError || null")
        if failure:
            raise OutputError(f"render: the page cannot be shown: {failure}")
        yield ask
        await call("Browser.close")
    finally:
        try:
            process.wait(5.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


async def _listening(file: Path, process: subprocess.Popen[bytes]) -> tuple[int, str]:
    """Port and path at which a browser that just started listens."""
    for _ in range(int(READY / 0.05)):
        if file.is_file():
            lines = file.read_text(encoding="utf-8").split()
            if len(lines) == 2:
                return int(lines[0]), lines[1]
        if process.poll() is not None:
            break
        await asyncio.sleep(0.05)
    raise InputError("render: the browser did not start")
