"""Random changes of valid files: each file loads, or raises an error that names the fault."""

from __future__ import annotations

import copy
import io
import json
import re
import warnings

import numpy as np
import pytest
import yaml
from hypothesis import strategies as st

import pin_nonideal as pn
from pin_nonideal.loading.robot_files import robot_folders

from .fuzzing import NAMES, NUMBERS, few_and_many, for_all, result_or_named_error
from .measure import finite

SMALL = [
    "four_bar",
    "slider_crank",
    "five_bar",
    "belt_oscillator",
    "loaded_joint",
    "knife_edge_sleigh",
    "rolling_disk",
]
ODD_TEXT = [
    "",
    "x",
    "nan",
    "inf",
    "1e999",
    "-1",
    "0",
    "0 0",
    "1 2 3 4",
    "0 0 0",
    "true",
    "&amp;",
    "../robot.urdf",
    "joint",
]
values = st.recursive(
    st.one_of(
        st.none(), st.booleans(), st.sampled_from(NUMBERS), st.sampled_from([n for n in NAMES if n != "\0"])
    ),
    lambda inner: st.one_of(
        st.lists(inner, max_size=3),
        st.dictionaries(
            st.sampled_from(["frame1", "joint", "name", "q", "kp", "PointAnchor", "x"]), inner, max_size=2
        ),
    ),
    max_leaves=4,
)


def places(tree, path=()):
    """Every place in a tree of dictionaries and lists."""
    yield path
    items = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    for key, inner in items:
        yield from places(inner, (*path, key))


def changed(tree, path, action, value):
    """The tree with another value, another key, or nothing at a place."""
    if not path:
        return value
    tree = copy.deepcopy(tree)
    holder = tree
    for key in path[:-1]:
        holder = holder[key]
    if action == "leave out":
        del holder[path[-1]]
    elif action == "rename" and isinstance(holder, dict):
        holder[str(value)] = holder.pop(path[-1])
    elif action == "double" and isinstance(holder, list):
        holder.append(holder[path[-1]])
    else:
        holder[path[-1]] = value
    return tree


def damaged(text, place, length, filling):
    """A text with a piece exchanged."""
    at = int(place * len(text))
    return text[:at] + filling + text[at + length :]


def loads_and_runs(folder):
    """Load a folder and run its scene; both succeed or raise a named error."""
    scene = result_or_named_error(lambda: pn.load(folder))
    if scene is None:
        return None
    run = result_or_named_error(lambda: pn.simulate(scene, 1e-3))
    if run is not None:
        finite(run)
    return scene


@pytest.fixture
def robot(tmp_path):
    """Write the two files of a robot into a folder."""

    def write(table, urdf):
        (tmp_path / "robot.yaml").write_bytes(table if isinstance(table, bytes) else table.encode())
        (tmp_path / "robot.urdf").write_bytes(urdf if isinstance(urdf, bytes) else urdf.encode())
        return tmp_path

    return write


def files(name):
    folder = robot_folders()[name]
    return [(folder / file).read_text(encoding="utf-8") for file in ("robot.yaml", "robot.urdf")]


TABLES = {name: files(name) for name in SMALL}


@few_and_many
def test_tables_of_robot_yaml(robot, examples):
    def check(name, place, action, value):
        table, urdf = TABLES[name]
        tree = yaml.safe_load(table)
        paths = list(places(tree))
        other = changed(tree, paths[int(place * len(paths))], action, value)
        return loads_and_runs(robot(yaml.safe_dump(other, allow_unicode=True), urdf))

    actions = st.sampled_from(["leave out", "rename", "double", "exchange", "exchange", "exchange"])
    for_all(check, st.sampled_from(SMALL), st.floats(0.0, 0.999), actions, values, examples=examples)


@few_and_many
def test_text_of_robot_yaml(robot, examples):
    def check(name, place, length, filling):
        table, urdf = TABLES[name]
        return loads_and_runs(robot(damaged(table.encode(), place, length, filling), urdf))

    for_all(
        check,
        st.sampled_from(SMALL),
        st.floats(0.0, 0.999),
        st.integers(0, 40),
        st.one_of(
            st.binary(max_size=6),
            st.sampled_from([b"*a", b"&a [*a]", b"!!python/object:os.system", b"\t", b"{", b"- ", b": "]),
        ),
        examples=examples,
    )


@few_and_many
def test_attributes_of_urdf(robot, examples):
    def check(name, place, value, leave_out):
        table, urdf = TABLES[name]
        found = list(re.finditer(r'\w+="([^"]*)"', urdf))
        hit = found[int(place * len(found))]
        start, end = hit.span() if leave_out else hit.span(1)
        return loads_and_runs(robot(table, urdf[:start] + ("" if leave_out else value) + urdf[end:]))

    for_all(
        check,
        st.sampled_from(SMALL),
        st.floats(0.0, 0.999),
        st.sampled_from(ODD_TEXT),
        st.booleans(),
        examples=examples,
    )


@few_and_many
def test_text_of_urdf(robot, examples):
    def check(name, place, length, filling):
        table, urdf = TABLES[name]
        return loads_and_runs(robot(table, damaged(urdf.encode(), place, length, filling)))

    for_all(
        check,
        st.sampled_from(SMALL),
        st.floats(0.0, 0.999),
        st.integers(0, 400),
        st.one_of(
            st.binary(max_size=6),
            st.sampled_from([b"<", b"</link>", b"<joint>", b"<!ENTITY a 'b'>", b"&a;", b"\0"]),
        ),
        examples=examples,
    )


@pytest.fixture(scope="module")
def trajectory(tmp_path_factory):
    run = pn.simulate(pn.load("four_bar"), 0.05, record=("energy", "forces"), output_dt=0.01)
    return run.save(tmp_path_factory.mktemp("run") / "run.npz").read_bytes()


@few_and_many
def test_bytes_of_a_trajectory(trajectory, tmp_path, examples):
    path = tmp_path / "run.npz"

    def check(place, length, filling):
        path.write_bytes(damaged(trajectory, place, length, filling))
        return result_or_named_error(lambda: str(pn.Trajectory.load(path)))

    for_all(check, st.floats(0.0, 0.999), st.integers(0, 30), st.binary(max_size=8), examples=examples)


@few_and_many
def test_arrays_of_a_trajectory(trajectory, tmp_path, examples):
    path = tmp_path / "run.npz"
    with np.load(io.BytesIO(trajectory)) as file:
        arrays = {key: file[key] for key in file.files}
    header = json.loads(str(arrays["header"]))
    others = st.one_of(
        st.sampled_from(
            [np.zeros(0), np.zeros((6, 3)), np.ones(6), np.array("text"), np.array([b"x"]), np.array(1)]
        ),
        st.just(None),
    )

    def check(key, array, header_key, header_value):
        spoiled = {**arrays, "header": np.array(json.dumps({**header, header_key: header_value}))}
        spoiled[key] = array
        with open(path, "wb") as file:
            np.savez(file, **{k: x for k, x in spoiled.items() if x is not None})
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            return result_or_named_error(lambda: str(pn.Trajectory.load(path)))

    for_all(
        check,
        st.sampled_from(sorted(arrays)),
        others,
        st.sampled_from(sorted(header)),
        values,
        examples=examples,
    )
