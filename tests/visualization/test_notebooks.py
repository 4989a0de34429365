"""A notebook shows figures as pictures, and scenes, runs, solutions, sweeps and states of rest as tables."""

from __future__ import annotations

import subprocess
import sys
from html.parser import HTMLParser

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

EVIL = "<script>alert(1)</script> & co"


class Tags(HTMLParser):
    """Collect the tags and attributes of a page, and check that each tag is closed."""

    def __init__(self, text):
        super().__init__()
        self.seen, self.open, self.attributes = set(), [], set()
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        self.seen.add(tag)
        self.attributes |= {key for key, _ in attributes}
        if tag != "br":
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def scene(**parts):
    return pn.Scene(pn.load("four_bar").model, name=EVIL, **parts)


def swept(name):
    return pn.load(name)


@pytest.fixture(scope="module")
def run():
    return pn.simulate(pn.load("four_bar"), 0.05, record=("energy", "laws", "a", "forces", "reactions"))


def shown(tmp_path):
    """Return each object with words of its table."""
    anchored = scene(laws=[pn.JointFriction("crank_joint", coulomb=0.1, name=EVIL)])
    run = pn.simulate(anchored, 0.01)
    parameters = [{"name": "four_bar"}, {"name": "five_bar"}]
    sweep = pn.sweep(swept, parameters, 0.01, jobs=1, store=tmp_path / "runs")
    strong, weak = (
        pn.load("four_bar").replace(laws=[pn.JointFriction("crank_joint", coulomb=limit, name=EVIL)])
        for limit in (100.0, 1e-3)
    )
    return {
        "rest": (pn.rest(strong), ["True", "margin", "friction of", "lam"]),
        "no rest": (pn.rest(weak, {"crank_joint": 0.5}), ["False", "reason", "times its limits"]),
        "equilibrium": (pn.equilibrium(weak), ["q", "lam", "stable", "largest unbalanced force"]),
        "scene": (anchored, ["degrees of freedom", "crank_joint"]),
        "trajectory": (run, ["steps", "violation", "wall time"]),
        "solution": (anchored.solve(*anchored.initial_state()), ["rank", "F_ideal"]),
        "sweep": (sweep, ["five_bar", "2 of 2 runs", "done"]),
    }


def test_tables_are_small_escaped_and_need_nothing_else(tmp_path):
    for name, (thing, words) in shown(tmp_path).items():
        text = thing._repr_html_()
        tags = Tags(text)
        assert tags.seen <= {"table", "caption", "tr", "th", "td", "br"}, name
        assert tags.attributes <= {"style"}, name
        assert "script>" not in text.replace("&lt;script&gt;", "").replace("&lt;/script&gt;", ""), name
        assert len(text) < 20_000, name
        for word in words:
            assert word in text, (name, text)
        assert "<table" not in repr(thing) + str(thing)


def test_a_long_sweep_shows_its_first_runs(tmp_path):
    sweep = pn.sweep(swept, [{"name": "loaded_joint"}] * 30, 1e-3, jobs=1, store=tmp_path / "runs")
    text = sweep._repr_html_()
    assert text.count("<tr>") == 22
    assert "10 more" in text


def test_runs_of_a_rollout_are_a_table():
    scene = pn.load("loaded_joint")
    runs = pn.rollout(scene, [[0.1], [0.2]], None, 0.1)
    assert isinstance(runs, list)
    text = runs._repr_html_()
    assert "2 runs" in text
    assert text.count("<tr>") == 3
    assert f">{len(runs[1].t)}<" in text


def test_a_figure_is_a_picture(run):
    figure = pn.plot(run, what="q")
    assert figure._repr_png_().startswith(b"\x89PNG")
    assert figure._repr_html_() is None


def test_ipython_shows_one_picture():
    """In a shell that has not imported pyplot, as a notebook without `%matplotlib inline`."""
    pytest.importorskip("IPython")
    code = """
import sys
from IPython.core.interactiveshell import InteractiveShell
import pin_nonideal as pn

shell = InteractiveShell.instance()
run = pn.simulate(pn.load("four_bar"), 0.05)
data, _ = shell.display_formatter.format(pn.plot(run, what="q"))
assert set(data) == {"text/plain", "image/png"}, set(data)
assert "matplotlib.pyplot" not in sys.modules
data, _ = shell.display_formatter.format(run)
assert set(data) == {"text/plain", "text/html"}, set(data)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_columns_have_names_without_spaces_and_units(run):
    from pin_nonideal.trajectory.columns import units

    table, unit = run.columns(), units(run)
    assert set(unit) == set(table)
    assert not any(" " in name for name in table)
    assert "crank_joint.C.main_bearing" in table
    expected = {
        "t": "s", "crank_joint.q": "rad", "crank_joint.v": "rad/s", "crank_joint.a": "rad/s^2",
        "crank_joint.tau": "N m", "crank_joint.F_ideal": "N m", "energy.total": "J", "violation": "m or rad",
        "loop.reaction.0": "N", "loop.reaction.5": "N m", "main_bearing.mode": "1",
    }  # fmt: skip
    assert {name: unit[name] for name in expected} == expected


def test_units_of_each_kind_of_joint():
    from pin_nonideal.trajectory.columns import units

    model = pin.Model()
    for name, joint in (
        ("base", pin.JointModelFreeFlyer()),
        ("slide", pin.JointModelPX()),
        ("wheel", pin.JointModelRUBZ()),
        ("ball", pin.JointModelSpherical()),
        ("table", pin.JointModelPlanar()),
    ):
        index = model.addJoint(model.njoints - 1, joint, pin.SE3.Identity(), name)
        model.appendBodyToJoint(index, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    found = units(pn.simulate(pn.Scene(model), 1e-3, record="a"))
    assert [found[f"base.q.{k}"] for k in range(7)] == ["m"] * 3 + ["1"] * 4
    assert [found[f"base.v.{k}"] for k in range(6)] == ["m/s"] * 3 + ["rad/s"] * 3
    assert (found["slide.q"], found["slide.a"]) == ("m", "m/s^2")
    assert (found["wheel.q"], found["wheel.v"]) == ("rad", "rad/s")
    assert [found[f"ball.q.{k}"] for k in range(4)] == ["1"] * 4
    assert [found[f"table.q.{k}"] for k in range(3)] == ["m", "m", "rad"]


def test_names_that_become_equal_are_told_apart():
    model = pin.Model()
    for name in ("a b", "a_b"):
        index = model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(index, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    table = pn.simulate(pn.Scene(model, v0=[1.0, 2.0]), 1e-3).columns()
    assert (table["a_b.v"][0], table["a_b.v_2"][0]) == (1.0, 2.0)


def test_units_of_a_frame(run):
    pytest.importorskip("pandas")
    frame = run.to_dataframe()
    assert frame.attrs["units"]["crank_joint.v"] == "rad/s"
    assert frame.attrs["units"]["t"] == "s"
    assert set(frame.columns) <= set(frame.attrs["units"])
