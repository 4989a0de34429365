"""Loops with rounded frames from an export: dependent rows are removed, and the run starts."""

from __future__ import annotations

import numpy as np
import pytest

import pin_nonideal as pn
from pin_nonideal.errors import LoopClosureError

ROUNDED = 3e-8  # position error of a pin in a CAD export [m]
TOLERANCE = 1e-5  # error of accelerations: rounding over the crank's length, times a few rad/s^2


def parallelogram(path, beside=0.0, tilt=0.0):
    """Write three parallel cranks on one coupler: the third adds no independent row except by rounding.

    Args:
        path: file.
        beside: distance of the pins of the second and third crank from the plane [m].
        tilt: tilt of the second and third axis [rad].
    """
    cranks = "".join(
        f'<body name="crank{i}" pos="{i} 0 0"><joint name="turn{i}" axis="0 1 {tilt * (i > 0)}"/>'
        '<geom type="capsule" fromto="0 0 0 0.1 0 1" size="0.02"/>'
        f'<site name="tip{i}" pos="0.1 {beside * (i > 0)} 1"/>{COUPLER if i == 0 else ""}</body>'
        for i in range(3)
    )
    pins = "".join(f'<connect name="pin{i}" site1="hole{i}" site2="tip{i}"/>' for i in (1, 2))
    path.write_text(f"<mujoco><worldbody>{cranks}</worldbody><equality>{pins}</equality></mujoco>")
    return path


COUPLER = """<body name="coupler" pos="0.1 0 1"><joint name="swing" axis="0 1 0"/>
    <geom type="capsule" fromto="0 0 0 2 0 0" size="0.02"/><site name="hole1" pos="1 0 0"/>
    <site name="hole2" pos="2 0 0"/></body>"""


@pytest.mark.parametrize(("beside", "tilt"), [(ROUNDED, 0.0), (ROUNDED, ROUNDED)])
def test_rows_that_depend_on_others_to_the_rounding_are_left_out(tmp_path, beside, tilt):
    exact = pn.load(parallelogram(tmp_path / "exact.xml"))
    scene = pn.load(parallelogram(tmp_path / "rounded.xml", beside, tilt))
    assert not any("assembly" in note for note in exact.notes)
    (note,) = [note for note in scene.notes if "within the tolerance of the assembly (1e-06)" in note]
    assert "depend on others and are left out" in note
    q, v = scene.initial_state()
    theirs, ours = exact.solve(*exact.initial_state()), scene.solve(q, v)
    assert ours.rank == theirs.rank == 3
    np.testing.assert_allclose(ours.a, theirs.a, atol=TOLERANCE)
    run, same = pn.simulate(scene, 0.5), pn.simulate(exact, 0.5)
    np.testing.assert_allclose(run.q[-1], same.q[-1], atol=TOLERANCE)


def test_a_gap_beyond_the_tolerance_is_an_open_loop(tmp_path):
    with pytest.raises(LoopClosureError, match=r'loop "pin1" does not close: gap 0\.0001 in row 1'):
        pn.load(parallelogram(tmp_path / "wide.xml", 1e-4))
    scene = pn.load(parallelogram(tmp_path / "wide.xml", 1e-4), assembly_tolerance=1e-3)
    assert any("within the tolerance of the assembly (0.001)" in note for note in scene.notes)
    scene.initial_state()


def welded(path, beside=0.0):
    """The same parallelogram, whose pins are bearings that are welded."""
    file = parallelogram(path, beside)
    bearings = "".join(
        f'<body name="bearing{i}" pos="{i} 0 0"><joint name="bearing{i}" axis="0 1 0"/><geom size="0.01"/>'
        f'<site name="on{i}"/></body>'
        for i in (1, 2)
    )
    text = file.read_text().replace('<site name="hole1"', f'{bearings}<site name="hole1"')
    for i in (1, 2):
        text = text.replace(f'<connect name="pin{i}" site1="hole', f'<weld name="pin{i}" site1="on')
    file.write_text(text)
    return file


def test_rows_of_welds_go_one_by_one(tmp_path):
    exact, scene = (
        pn.load(welded(tmp_path / name, beside)) for name, beside in (("e.xml", 0.0), ("r.xml", ROUNDED))
    )
    assert [type(c) for c in exact.constraints] == [pn.FrameAnchor, pn.FrameAnchor]
    assert any("within the tolerance of the assembly" in note for note in scene.notes)
    theirs, ours = exact.solve(*exact.initial_state()), scene.solve(*scene.initial_state())
    assert ours.rank == theirs.rank == 5
    np.testing.assert_allclose(ours.a, theirs.a, atol=TOLERANCE)
    run, same = pn.simulate(scene, 2.0), pn.simulate(exact, 2.0)  # through large turns
    assert np.abs(same.q[-1] - same.q[0]).max() > 1.0
    np.testing.assert_allclose(run.q[-1], same.q[-1], atol=TOLERANCE)


def test_loops_that_depend_on_each_other_beyond_the_tolerance_are_told(tmp_path):
    """Cranks of nearly equal length lock the mechanism."""
    file = parallelogram(tmp_path / "long.xml")
    text = file.read_text().replace('name="tip2" pos="0.1 0.0 1"', 'name="tip2" pos="0.10003 0 1"')
    file.write_text(text.replace('name="hole2" pos="2 0 0"', 'name="hole2" pos="2.00003 0 0"'))
    (note,) = [note for note in pn.load(file).notes if "beyond the tolerance of the assembly" in note]
    assert "they may lock intended motion; load(..., assembly_tolerance=0.0001)" in note
    scene = pn.load(file, assembly_tolerance=1e-4)
    assert scene.solve(*scene.initial_state()).rank == 3


def linkage(path, tilt=0.0):
    """A four-bar whose crank and rocker are joined by a coupler that is welded to the rocker's bearing."""
    path.write_text(
        f"""<mujoco><worldbody><body euler="20 30 40">
        <body name="crank"><joint name="crank" axis="0 0 1"/><geom type="capsule" fromto="0 0 0 0.3 0.2 0"
        size="0.02"/><body name="coupler" pos="0.3 0.2 0"><joint name="swing" axis="0 0 1"/>
        <geom type="capsule" fromto="0 0 0 0.9 0.2 0" size="0.02"/>
        <site name="end" pos="0.9 0.2 0"/></body></body>
        <body name="rocker" pos="1 0 0"><joint name="rocker" axis="{tilt} 0 1"/><geom type="capsule"
        fromto="0 0 0 0.2 0.4 0" size="0.02"/><body name="bearing" pos="0.2 0.4 0"><joint name="bearing"
        axis="0 {tilt} 1"/><geom size="0.02"/><site name="pin"/></body></body>
        </body></worldbody><equality><weld name="pin" site1="end" site2="pin"/>
        <weld name="again" site1="end" site2="pin"/></equality></mujoco>"""
    )
    return path


@pytest.mark.parametrize("tilt", [0.0, 1e-15, ROUNDED])
def test_rows_out_of_the_plane_decide_nothing(tmp_path, tilt):
    """Such rows are zero or rounding, and would have a random direction at unit length."""
    scenes = [pn.load(linkage(tmp_path / f"{t}.xml", t), q0={"crank": 0.3}) for t in (0.0, tilt)]
    flat, scene = scenes
    assert not any("beyond the tolerance" in note for note in scene.notes)
    if tilt < 1e-12:
        assert [type(c) for c in scene.constraints] == [pn.FrameAnchor] * 2
        assert not any("assembly" in note for note in scene.notes)
    theirs, ours = (s.solve(*s.initial_state()) for s in scenes)
    assert ours.rank == theirs.rank == 3
    np.testing.assert_allclose(ours.a, theirs.a, atol=TOLERANCE)
    run, same = (pn.simulate(s, 1.0) for s in (scene, flat))
    np.testing.assert_allclose(run.q[-1], same.q[-1], atol=TOLERANCE)
