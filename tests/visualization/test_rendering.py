"""Pictures and videos from Python and from the command line, and runs in a meshcat window."""

from __future__ import annotations

import io
import re
import sys
from pathlib import Path
from typing import Any

import meshcat
import numpy as np
import pinocchio as pin
import pytest
from PIL import Image

import pin_nonideal as pn
from pin_nonideal.cli import main as cli
from pin_nonideal.errors import InputError, OutputError
from pin_nonideal.visualization import rendering

from ..support.replay_browser import BROWSER, headless_browser

needs_browser = pytest.mark.skipif(BROWSER is None, reason="needs chromium or google-chrome on the path")


@pytest.fixture(scope="module")
def run() -> Any:
    return pn.simulate(pn.load("four_bar"), 1.0, output_dt=0.01, record=("forces", "energy"))


@needs_browser
def test_a_picture_shows_the_robot_at_its_time(run: Any, tmp_path: Path) -> None:
    pictures = []
    for time in (0.0, 0.8):
        path = pn.render(run, tmp_path / f"{time}.png", width=320, height=200, time=time)
        pictures.append(np.asarray(Image.open(path).convert("RGB")).astype(int))
    assert pictures[0].shape == (200, 320, 3)
    assert np.count_nonzero(np.abs(pictures[0] - pictures[1]).max(axis=2) > 30) > 100


@pytest.mark.slow
@needs_browser
def test_a_saved_run_becomes_a_moving_picture(run: Any, tmp_path: Path, capsys: Any) -> None:
    saved, out = run.save(tmp_path / "run.npz"), tmp_path / "out.gif"
    words = [
        "render",
        str(saved),
        str(out),
        "--width",
        "160",
        "--height",
        "100",
        "--seconds",
        "0.5",
        "--fps",
        "8",
    ]
    assert cli.main(words) == 0
    assert f"wrote {out}" in capsys.readouterr().out
    with Image.open(out) as moving:
        assert moving.size == (160, 100)
        assert moving.n_frames == 4
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.gif", "run.npz"]


@pytest.mark.slow
@needs_browser
def test_a_video_is_written(run: Any, tmp_path: Path) -> None:
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")
    video = pn.render(run, tmp_path / "a.mp4", width=160, height=100, seconds=0.25, fps=8)
    assert imageio_ffmpeg.count_frames_and_secs(str(video)) == (2, 0.25)


@needs_browser
@pytest.mark.slow
@pytest.mark.parametrize("ending", ["mp4", "webm"])
def test_a_video_is_played(run: Any, tmp_path: Path, ending: str) -> None:
    """Frames of the video equal the pictures at their times."""
    video = pn.render(run, tmp_path / f"a.{ending}", width=319, height=200, seconds=1.0, fps=8)
    stills = [pn.render(run, tmp_path / f"{k}.png", width=320, height=200, time=k / 7.0) for k in (3, 4, 5)]
    (tmp_path / "a.html").write_text(f'<body style="margin: 0"><video src="{video.name}"></video>')
    with headless_browser() as browser:
        page = browser.new_page(viewport={"width": 320, "height": 200})
        page.goto((tmp_path / "a.html").as_uri())
        shown = """async (time) => {
          const video = document.querySelector("video");
          const found = await new Promise((done, failed) => {
            video.onerror = () => failed(new Error(video.error.message));
            video.onloadeddata = () => {
              const look = (now, frame) =>  // the first frame may still come
                frame.mediaTime > 0 ? done(frame.mediaTime) : video.requestVideoFrameCallback(look);
              video.requestVideoFrameCallback(look);
              video.currentTime = time;
            };
            video.load();
          });
          await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
          return [found, video.duration, video.videoWidth, video.videoHeight];
        }"""
        time, duration, *size = page.evaluate(shown, 4.5 / 8.0)
        assert [time, duration] == pytest.approx([4.0 / 8.0, 1.0], abs=2e-3)
        assert size == [320, 200]
        frame, *pictures = [
            np.asarray(Image.open(one).convert("RGB")).astype(int)
            for one in (io.BytesIO(page.screenshot()), *stills)
        ]
    apart = [np.abs(frame - picture) for picture in pictures]
    assert np.median(apart[1], axis=(0, 1)).max() <= 2  # colors
    different = [np.count_nonzero(one.max(axis=2) > 60) for one in apart]
    assert 3 * different[1] < min(different[0], different[2])  # the edges of small text


def test_what_cannot_be_rendered_is_told(run: Any, tmp_path: Path, monkeypatch: Any) -> None:
    with pytest.raises(OutputError, match=r'"a\.xyz" must end in one of \.png, \.gif, \.webm, \.mp4$'):
        pn.render(run, "a.xyz")
    with pytest.raises(InputError, match=r"render: seconds must be"):
        pn.render(run, "a.gif", seconds=0.0)
    with pytest.raises(
        InputError, match=r"^render: seconds times fps must be at most 100000 pictures; got 6e"
    ):
        pn.render(run, "a.gif", fps=1e300)
    with pytest.raises(InputError, match=r"^render: fps must be at least 0\.01; got 1e-300"):
        pn.render(run, "a.gif", fps=1e-300)
    with pytest.raises(InputError, match=r"^render: time must be a number; got ''"):
        pn.render(run, "a.png", time="")
    with pytest.raises(InputError, match=r"^render: run must be a Trajectory; got NoneType"):
        pn.render(None, "a.png")
    monkeypatch.setattr(rendering.shutil, "which", lambda name: None)
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    message = "render: .mp4 needs ffmpeg on the path, or pip install 'pin-nonideal[video]'"
    with pytest.raises(OutputError, match=f"^{re.escape(message)}"):
        pn.render(run, tmp_path / "a.mp4")
    with pytest.raises(OutputError, match=r"^render needs a browser on the path: chromium"):
        pn.render(run, tmp_path / "a.png")
    assert list(tmp_path.iterdir()) == []


class Window:
    """Recorder of the commands that `meshcat.Visualizer` sends to its window."""

    def __init__(self) -> None:
        self.sent: list[Any] = []

    def send(self, command: Any) -> None:
        self.sent.append(command.lower())


def test_an_open_window_is_filled_with_robot_animation_and_forces(run: Any) -> None:
    window = Window()
    shown = pn.replay(run, viewer=meshcat.Visualizer(window=window))
    assert isinstance(shown, pin.visualize.MeshcatVisualizer)
    objects = [one["path"] for one in window.sent if one["type"] == "set_object"]
    for item in run.scene.visual_model.geometryObjects:
        assert any(path.endswith(f"visuals/{item.name}") for path in objects)
    assert any("/forces/0/head" in path for path in objects)
    (animation,) = [one for one in window.sent if one["type"] == "set_animation"]
    tracks = {
        clip["path"]: {t["name"]: t for t in clip["clip"]["tracks"]} for clip in animation["animations"]
    }
    data, visual_data = run.scene.model.createData(), run.scene.visual_model.createData()
    pin.updateGeometryPlacements(run.scene.model, data, run.scene.visual_model, visual_data, run.q[-1])
    for item, placement in zip(run.scene.visual_model.geometryObjects, visual_data.oMg, strict=True):
        (track,) = [tracks[path] for path in tracks if path.endswith(f"visuals/{item.name}")]
        key = next(values for name, values in track.items() if name.endswith("position"))["keys"][-1]
        np.testing.assert_allclose(key["value"], placement.translation, atol=1e-6)


def test_a_window_takes_one_run(run: Any) -> None:
    message = "replay: viewer takes one run and no path"
    for arguments in (([run, run], None), (run, "a.html")):
        with pytest.raises(InputError, match=f"^{re.escape(message)}$"):
            pn.replay(*arguments, viewer=meshcat.Visualizer(window=Window()))
