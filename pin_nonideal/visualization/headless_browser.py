"""Replay page in a headless browser, controlled through the browser's debugging interface."""

from __future__ import annotations

import asyncio
import itertools
import json
import shutil
import subprocess
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from pin_nonideal.errors import InputError, OutputError

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "msedge")
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
TIMEOUT = 60.0  # time limit for the browser to start, to draw the page, and to answer [s]


@asynccontextmanager
async def open_page(folder: Path, address: str, size: list[int]) -> AsyncIterator[Any]:
    """Open a page in a headless browser, and yield a function that evaluates expressions in it.

    Args:
        folder: folder for the browser's temporary files.
        address: address of the page.
        size: width and height of the window [pixels].

    Raises:
        OutputError: no browser is found, or the page cannot be displayed.
    """
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
        port, door = await _wait_for_port(profile / "DevToolsActivePort", process)
        socket = await websocket_connect(f"ws://127.0.0.1:{port}{door}", max_message_size=1 << 28)
        numbers = itertools.count(1)

        async def call(method: str, session: str | None = None, **values: Any) -> Any:
            number = next(numbers)
            message = {"id": number, "method": method, "params": values}
            await socket.write_message(json.dumps(message | ({"sessionId": session} if session else {})))
            while True:
                answer = await asyncio.wait_for(socket.read_message(), TIMEOUT)
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

        for _ in range(int(TIMEOUT / 0.1)):
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


async def _wait_for_port(file: Path, process: subprocess.Popen[bytes]) -> tuple[int, str]:
    """Return the port and path at which a starting browser listens."""
    for _ in range(int(TIMEOUT / 0.05)):
        if file.is_file():
            lines = file.read_text(encoding="utf-8").split()
            if len(lines) == 2:
                return int(lines[0]), lines[1]
        if process.poll() is not None:
            break
        await asyncio.sleep(0.05)
    raise InputError("render: the browser did not start")
