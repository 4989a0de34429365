"""The file of a replay: writing, contents and errors, without a browser."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.errors import InputError, OutputError
from pin_nonideal.visualization.page.payload import packed_runs
from pin_nonideal.visualization.replay import replay

from ..support.replay_runs import four_bar, jointed, run_of


def test_the_file_is_the_page_and_overwrites_an_older_one(tmp_path: Path) -> None:
    path = tmp_path / "a.html"
    path.write_text("older")
    run = four_bar()
    assert replay(run, str(path)) == path
    assert path.read_text(encoding="utf-8") == replay(run).text
    assert os.listdir(tmp_path) == ["a.html"]
    new = tmp_path / "b.txt"
    new.touch()
    assert path.stat().st_mode == new.stat().st_mode  # a temporary file's own permissions would be narrower


@pytest.mark.parametrize("name", [name for name, _ in pn.robots()])
def test_every_robot_of_the_package_can_be_replayed(name: str) -> None:
    scene = pn.load(name)
    run = pn.simulate(scene, 1e-3, record=("forces", "energy"))
    content = packed_runs([run], ["run"], 1000.0, "title", None, True)
    header = json.loads(content[4 : 4 + int.from_bytes(content[:4], "little")])
    assert header["visuals"]
    assert len(header["joints"]) == scene.model.njoints
    assert {mark["name"] for mark in header["marks"]} >= {name for name, *_ in scene.anchor_frames}
    assert 0.05 < header["view"]["size"] < 10.0


def test_the_licenses_of_what_is_inside_are_in_plain_text() -> None:
    text = replay(four_bar()).text
    for words in (
        "meshcat, the viewer of this page",
        "three 0.132.2 (MIT)",
        "Copyright (c) 2018 Robin Deits",
        "Apache",
    ):
        assert words in text


@pytest.mark.parametrize("place", ["absent/a.html", "folder"])
def test_a_file_that_cannot_be_written_is_an_error_and_leaves_nothing(tmp_path: Path, place: str) -> None:
    (tmp_path / "folder").mkdir()
    reason = "No such file or directory" if place.startswith("absent") else "Is a directory"
    message = f'cannot write the replay to "{tmp_path / place}": {reason}; name a file in a folder '
    message += "that can be written"
    with pytest.raises(OutputError, match=f"^{re.escape(message)}$"):
        replay(four_bar(), tmp_path / place)
    assert os.listdir(tmp_path) == ["folder"]
    assert os.listdir(tmp_path / "folder") == []


def test_a_write_that_breaks_off_keeps_the_older_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.html"
    path.write_text("older")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(OutputError, match="No space left on device"):
        replay(four_bar(), path)
    assert path.read_text() == "older"
    assert os.listdir(tmp_path) == ["a.html"]


@pytest.mark.parametrize("fps", [0.0, -1.0, float("nan"), float("inf"), "60"])
def test_frames_a_second_must_be_a_positive_number(fps: Any) -> None:
    with pytest.raises(InputError, match="replay: fps must be"):
        replay(four_bar(), fps=fps)


def test_a_run_without_its_scene_is_refused() -> None:
    run = four_bar()
    run.scene = None
    message = "a replay needs the scene of the run, which a trajectory read from a file has not: "
    message += "pass dataclasses.replace(run, scene=scene)"
    with pytest.raises(InputError, match=f"^{re.escape(message)}$"):
        replay(run)


def test_a_title_must_be_text() -> None:
    with pytest.raises(InputError, match="replay: title must be a string or None; got 3"):
        replay(four_bar(), title=3)  # type: ignore[arg-type]


@pytest.mark.parametrize("switch", ["compress", "forces"])
def test_switches_are_true_or_false(switch: str) -> None:
    with pytest.raises(InputError, match=f"^replay: {switch} must be one of True, False; got 3$"):
        replay(four_bar(), **{switch: 3})  # type: ignore[arg-type]


def test_equal_shapes_are_stored_once() -> None:
    model = jointed(*[pin.JointModelRZ()] * 4)  # four equal bars, drawn in place of geometry
    content = packed_runs(
        [run_of(model, [0.0, 1.0], lambda t: np.full(4, t))], ["run"], 60.0, "title", None, True
    )
    header = json.loads(content[4 : 4 + int.from_bytes(content[:4], "little")])
    assert len(header["visuals"]) == 8
    assert len(header["shapes"]) == 2


def test_no_data_of_a_model_are_made(monkeypatch: pytest.MonkeyPatch) -> None:
    """They hold nv^3 numbers: gigabytes for a chain of a thousand joints."""
    run = four_bar()

    def refused(*_: object) -> None:
        raise AssertionError("a replay asked for the data of its model")

    monkeypatch.setattr(pin.Model, "createData", refused)
    monkeypatch.setattr(pin, "Data", refused)
    assert replay(run).text


def test_a_missing_viewer_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    message = "a replay needs the package meshcat, which is missing: pip install meshcat"
    with pytest.raises(OutputError, match=f"^{message}$"):
        replay(four_bar())
    empty = SimpleNamespace(submodule_search_locations=[str(tmp_path)])
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: empty)
    with pytest.raises(OutputError, match=r"which cannot be read: pip install meshcat==0\.3\.2"):
        replay(four_bar())


def test_writing_a_replay_imports_neither_meshcat_nor_its_server() -> None:
    script = (
        "import sys\n"
        "from tests.support.replay_runs import four_bar\n"
        "from pin_nonideal.visualization.replay import replay\n"
        "replay(four_bar())\n"
        "print(sorted({'meshcat', 'zmq', 'tornado', 'umsgpack', 'matplotlib', 'scipy'} & set(sys.modules)))\n"
    )
    root = Path(__file__).resolve().parents[2]
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=root, capture_output=True, text=True, check=False
    )
    assert done.stdout.strip() == "[]", done.stderr


def test_shapes_for_collisions_are_drawn_where_there_are_no_others() -> None:
    model, geometry = jointed(pin.JointModelFreeFlyer()), pin.GeometryModel()
    geometry.addGeometryObject(pin.GeometryObject("can", 1, pin.SE3.Identity(), coal.Cylinder(0.1, 0.3)))
    geometry.addGeometryObject(pin.GeometryObject("table", 0, pin.SE3.Identity(), coal.Box(1.0, 1.0, 0.1)))
    scene = pn.Scene(model, collision_model=geometry)
    content = packed_runs([pn.simulate(scene, 1e-3)], ["run"], 60.0, "title", None, True)
    header = json.loads(content[4 : 4 + int.from_bytes(content[:4], "little")])
    assert [visual["name"] for visual in header["visuals"]] == ["can", "table"]
    assert all(max(visual["color"][:3]) > 0.0 for visual in header["visuals"])
