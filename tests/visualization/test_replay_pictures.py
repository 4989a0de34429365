"""Replays of fast, long, large, small and failed runs, in a browser."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import replace as changed_run
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.core_loader import core
from pin_nonideal.loading.robot_files import robots
from pin_nonideal.visualization.page.style import EVENTS, FORCES, MARKS, MODES

from ..support.paper_examples import example
from ..support.replay_browser import Watched, changed, headless_browser
from ..support.replay_runs import jointed, run_of

# Closure gap of a drawn loop, relative to the smallest link.
GAP = 1e-2
# Errors relative to the model's size: at frames, with 32-bit floats and products of rotations, and between.
AT_FRAMES, BETWEEN = 1e-5, 1e-3


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with headless_browser() as browser:
        yield browser


@pytest.fixture
def opened(browser: Any, tmp_path: Path) -> Iterator[Any]:
    """Open replays of runs, and check that no page reports an error."""
    pages = []

    def open_run(run: Any, **options: Any) -> Watched:
        pages.append(Watched(browser, pn.replay(run, tmp_path / f"{len(pages)}.html", **options)))
        assert pages[-1].run("() => window.replayError || null") is None
        return pages[-1]

    yield open_run
    for page in pages:
        assert page.complaints == []
        assert len(page.requests) == 1
        page.close()


def shows(picture: np.ndarray, color: str, within: int = 40) -> int:
    """Pixels of about a color."""
    wanted = np.array([int(color[i : i + 2], 16) for i in (1, 3, 5)])
    return int(np.count_nonzero(np.abs(picture - wanted).max(axis=2) < within))


@pytest.mark.slow
def test_a_mechanism_of_hundredths_of_a_second_is_drawn_closed_and_played_slowly(opened: Any) -> None:
    """Andrews' squeezer: 0.03 s, links from 7 mm."""
    scene = pn.load("andrews_squeezer")
    page = opened(pn.simulate(scene, 0.03))
    assert len(page.run("() => replay.times")) >= 600
    assert 5.0 <= 0.03 / page.run("() => replay.speed") <= 15.0
    gaps = [
        page.run("t => { replay.seek(t); return replay.gap; }", float(t))
        for t in np.random.default_rng(1).uniform(0.0, 0.03, 60)
    ]
    assert max(gaps) < GAP * 0.007
    assert "gap drawn" in page.page.locator("#heading").inner_text()


@pytest.mark.slow
def test_forty_revolutions_a_second_are_drawn_closed(opened: Any) -> None:
    """A four-bar whose crank is driven at 251 rad/s, against Pinocchio at frames and between them."""
    drive = pn.load("four_bar")
    crank = drive.model.names[1]
    turning = pn.PrescribedMotion(crank, pn.polynomial([float(drive.q0[0]), 80.0 * np.pi]), name="motor")
    scene = pn.Scene(drive.model, constraints=[*drive.constraints, turning], visual_model=drive.visual_model)
    run = pn.simulate(scene, 0.5, output_dt=1e-3, rtol=1e-9, atol=1e-9)
    page, data = opened(run), scene.model.createData()
    size, link = (
        1.0,
        min(np.linalg.norm(place.translation) for place in list(scene.model.jointPlacements)[2:]),
    )
    for k in (0, 137, 499):
        pin.forwardKinematics(scene.model, data, run.q[k])
        for name, pose in page.poses(float(run.t[k]))["joints"].items():
            exact = data.oMi[scene.model.getJointId(name)].homogeneous
            np.testing.assert_allclose(pose, exact, atol=AT_FRAMES * size)
    fine = pn.simulate(scene, 0.5, output_dt=1e-4, rtol=1e-9, atol=1e-9)
    for k in np.random.default_rng(3).integers(0, len(fine.t), 25):
        pin.forwardKinematics(scene.model, data, fine.q[k])
        for name, pose in page.poses(float(fine.t[k]))["joints"].items():
            exact = data.oMi[scene.model.getJointId(name)].homogeneous
            np.testing.assert_allclose(pose, exact, atol=BETWEEN * size)
        assert page.run("() => replay.gap") < GAP * link


@functools.cache
def paper_run(name: str) -> tuple[Any, Any]:
    """Return an example of the paper, with the printed forces."""
    options = {"record": ("forces", "energy"), "rtol": 1e-10, "atol": 1e-10}
    if name == "particle":
        particle, q = example("paper_a_particle").Particle(), np.array([0.3, -0.2, 0.9])
        run = pn.simulate(particle.scene(), 2.0, q=q, v=particle.start(q, (1.1, -0.6)), **options)
        return run, lambda t, q, v: particle.paper_force(t, q, v)
    if name == "ring":
        ring = example("paper_b_ring").Ring()
        run = pn.simulate(ring.scene(), 0.5, *ring.at(0.0, 4.0), **options)
        return run, lambda t, q, v: ring.paper_force(q, v, ring.mu * abs(ring.normal(q, v)))
    block = example("paper_c_incline").Incline()
    run = pn.simulate(block.scene(), 1.0, *block.at(0.0, 0.1), **options)
    return run, lambda t, q, v: (block.paper_ideal(t), block.paper_nonideal(t, v))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ring", "particle", "incline"])
def test_the_papers_examples_show_constraint_path_and_forces(opened: Any, name: str) -> None:
    run, paper = paper_run(name)
    page = opened(run)
    k = len(run.t) // 2
    picture = page.picture(float(run.t[k]))
    for color in (FORCES["ideal"], FORCES["nonideal"]):
        assert shows(picture, color) > 20, color
    # The guide is half transparent over the sky: it differs from a page without it.
    page.run("() => replay.show('guides', false)")
    assert changed(picture, page.picture(float(run.t[k]))) > 200, MARKS["guide"]
    page.run("() => { replay.show('guides', true); replay.show('trails', false); }")
    assert changed(picture, page.picture(float(run.t[k]))) > 30
    shown = [
        [float(x) for x in text.strip("()").split(",")]
        for text in page.page.locator("#forces small").all_inner_texts()
    ]
    kinds = page.page.locator("#forces th").all_inner_texts()[1:]
    for kind, expected in zip(("ideal", "nonideal"), paper(run.t[k], run.q[k], run.v[k]), strict=True):
        found = shown[kinds.index(kind)][: len(expected)]
        np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-3)


def test_a_ring_closes_and_an_incline_vibrates() -> None:
    from pin_nonideal.visualization.page.constraint_curves import guides_of
    from pin_nonideal.visualization.page.frames import sample

    run, _ = paper_run("ring")
    (ring,) = guides_of(run, sample(run))
    assert ring.closed
    np.testing.assert_allclose(np.linalg.norm(ring.points[:, :2], axis=1), 1.0, atol=1e-9)
    run, _ = paper_run("incline")
    motion = sample(run)
    (plane,) = guides_of(run, motion)
    block = example("paper_c_incline").Incline()
    x, y = plane.points[:, 0], plane.points[:, 1]
    np.testing.assert_allclose(y, x * np.tan(block.alpha), atol=1e-9)
    lift = block.beta * np.sin(block.omega * motion.times)
    normal = np.array([-np.sin(block.alpha), np.cos(block.alpha), 0.0])
    np.testing.assert_allclose(plane.shift, -np.outer(lift * np.cos(block.alpha), normal), atol=1e-9)


def test_a_surface_is_traced_beside_the_path_of_its_point() -> None:
    """A particle on the sphere x^2 + y^2 + z^2 = 1."""
    from pin_nonideal.visualization.page.constraint_curves import guides_of
    from pin_nonideal.visualization.page.frames import sample

    model = jointed(pin.JointModelTranslation(), lever=0.0)
    sphere = pn.UserConstraint(
        lambda t, q, v, data: (q[None, :].copy(), np.array([-(v @ v)])),
        1,
        residual=lambda t, q: np.array([(q @ q - 1.0) / 2.0]),
        rate=lambda t, q, v: np.array([q @ v]),
    )
    q, v = np.array([0.0, 0.6, -0.8]), np.array([1.0, 0.0, 0.0])
    run = pn.simulate(pn.Scene(model, constraints=[sphere], q0=q, v0=v), 1.0)
    (surface,) = guides_of(run, sample(run))
    assert surface.kind == "surface"
    assert len(surface.points) > 300
    np.testing.assert_allclose(np.linalg.norm(surface.points, axis=1), 1.0, atol=1e-9)
    assert np.linalg.norm(surface.points[0] - surface.points[surface.columns - 1]) > 0.3


MORE = ("rolling_disk", "belt_oscillator", "knife_edge_sleigh", "andrews_squeezer")
IN_VIEW = ["four_bar", *MORE]


def stays_in_view(page: Watched, name: str) -> None:
    start, duration = page.run("() => [replay.start, replay.duration]")
    canvas = page.page.locator("#scene").bounding_box()
    for part in np.linspace(0.0, 1.0, 20):
        box = page.run("t => { replay.seek(t); return replay.box(); }", start + float(part) * duration)
        left, top, right, bottom = box
        assert 0.0 <= left <= right <= canvas["width"], (name, part, box)
        assert 0.0 <= top <= bottom <= canvas["height"], (name, part, box)


@pytest.mark.slow
@pytest.mark.parametrize("name", IN_VIEW)
def test_a_robot_stays_in_view(opened: Any, name: str) -> None:
    run = pn.simulate(pn.load(name), 0.03 if name == "andrews_squeezer" else 3.0)
    page = opened(run)
    stays_in_view(page, name)
    first, later = page.picture(float(run.t[0])), page.picture(float(run.t[len(run.t) // 3]))
    assert changed(first, later) > 30


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name, _ in robots() if name not in IN_VIEW])
def test_every_robot_stays_in_view(opened: Any, name: str) -> None:
    stays_in_view(opened(pn.simulate(pn.load(name), 1.0)), name)


@pytest.mark.slow
def test_a_chain_of_500_dofs_stays_in_view(opened: Any) -> None:
    model = jointed(*[pin.JointModelRY()] * 500)
    run = run_of(model, np.linspace(0.0, 1.0, 20), lambda t: 0.01 * np.sin(t + 0.1 * np.arange(500.0)))
    stays_in_view(opened(run), "chain")


@pytest.mark.slow
def test_a_travel_of_a_thousand_seconds_is_followed(opened: Any) -> None:
    """A cart with a pendulum that goes 5 km: the camera goes with it."""
    model = jointed(pin.JointModelPX(), pin.JointModelRY())
    model.inertias[1] = pin.Inertia(1.0, np.zeros(3), 0.01 * np.eye(3))
    run = run_of(model, np.linspace(0.0, 1000.0, 2001), lambda t: np.array([5.0 * t, np.sin(t)]))
    stays_in_view(opened(run), "cart")


@pytest.mark.slow
def test_forty_windows_take_few_draw_calls(opened: Any) -> None:
    page = opened(pn.simulate(pn.load("n_four_bar", N=40), 0.2, record=("forces", "energy")))
    drawn = page.run("() => replay.draws")
    assert drawn["calls"] <= 60
    assert drawn["triangles"] < 375_000


def test_a_run_that_failed_says_where_and_why(opened: Any, tmp_path: Path) -> None:
    model = jointed(pin.JointModelRZ())

    def torque(t: float, q: Any, v: Any) -> Any:
        if t > 0.5:
            raise ValueError("the cable broke")
        return np.zeros(1)

    with pytest.raises(pn.UserFunctionError) as caught:
        pn.simulate(pn.Scene(model, actuation=torque), 2.0, dt=0.01, method="rk4")
    run = caught.value.trajectory
    assert "the cable broke" in run.failure
    assert "stopped early: " in str(run)
    again = pn.Trajectory.load(run.save(tmp_path / "run.npz"))
    assert again.failure == run.failure
    page = opened(run)
    told = page.page.locator("#failure").inner_text()
    assert "the cable broke" in told
    assert "stopped at 0.5" in told
    whole = opened(changed_run(run, failure=None))
    assert not whole.page.locator("#failure").is_visible()


def test_a_hundred_thousand_samples_are_a_small_page_that_keeps_extremes(opened: Any, tmp_path: Path) -> None:
    model = jointed(*[pin.JointModelRZ()] * 3)
    t = np.linspace(0.0, 100.0, 100_001)
    run = run_of(model, [0.0, 1.0], lambda x: np.zeros(3))
    q = np.column_stack([np.sin(t), np.cos(3.0 * t), 0.1 * t])
    v = np.column_stack([np.cos(t), -3.0 * np.sin(3.0 * t), np.full(len(t), 0.1)])
    v[43_210, 0] = 50.0
    run = type(run)(**{**vars(run), "t": t, "q": q, "v": v, "violation": np.zeros(len(t))})
    page = opened(run, plots=["v"])
    assert pn.replay(run, tmp_path / "long.html", plots=["v"]).stat().st_size < 3_000_000
    page.run("t => replay.seek(t)", float(t[43_210]))
    reading = page.page.locator(".plot li", has_text="j0").locator("b").inner_text()
    assert float(reading) == pytest.approx(50.0)


def chattering(count: int = 2000) -> Any:
    """Dense events in the first half, four in the second; an element that changes its mode at each."""
    t = np.concatenate([np.linspace(0.0, 0.5, count), [0.6, 0.7, 0.8, 0.9, 1.0]])
    kinds = ["slip" if k % 2 else "stick" for k in range(len(t))]
    return run_of(
        jointed(pin.JointModelRZ()),
        t,
        lambda x: np.array([x]),
        modes=np.array([[k % 2] for k in range(len(t))], dtype=np.int8),
        element_names=["joint friction with a long name"],
        events=[SimpleNamespace(time=x, kind=kind, element="e") for x, kind in zip(t, kinds, strict=True)],
    )


def test_dense_events_and_modes_are_drawn_by_their_density(opened: Any) -> None:
    page = opened(chattering())
    read = """([id, x, y, w, h]) => {
      const canvas = document.getElementById(id), ratio = window.devicePixelRatio;
      const { data } = canvas.getContext("2d").getImageData(x * ratio, y * ratio, w * ratio, h * ratio);
      const seen = new Map();
      for (let i = 0; i < data.length; i += 4) {
        const key = data.slice(i, i + 3).join();
        if (data[i + 3] > 250) seen.set(key, (seen.get(key) || 0) + 1);
      }
      return [...seen.values()].sort((a, b) => b - a).slice(0, 2);
    }"""
    left = page.run("() => replay.margin")
    # Sticking and slipping alternate evenly: within the dense half both have half of the area.
    for where in ("bands", "timeline"):
        counts = page.run(read, [where, left + 40, 2 if where == "bands" else 6, 200, 8])
        assert len(counts) == 2
        assert counts[0] / sum(counts) < 0.65, (where, counts)


def test_what_rests_is_drawn_as_sticking_to_the_end() -> None:
    run = chattering(3)
    run.modes[:] = 0
    from pin_nonideal.visualization.page.mode_timeline import mode_bands

    assert mode_bands(run.t, run.modes) == [[(0.0, 1.0, 0)]]


def test_legends_are_whole_and_what_is_left_out_is_said(opened: Any) -> None:
    model = jointed(*[pin.JointModelRZ()] * 27)
    page = opened(run_of(model, np.linspace(0.0, 1.0, 9), lambda t: t * np.arange(27.0)))
    assert "8 of 27" in page.page.locator(".plot h2").inner_text()
    clipped = page.run("""() => [...document.querySelectorAll(".plot ul")].filter((list) =>
      list.scrollHeight > list.clientHeight + 1 || list.scrollWidth > list.clientWidth + 1).length""")
    assert clipped == 0
    assert page.page.locator(".plot li").count() == 8


WIDER = ((900, 500), (1400, 900))


@pytest.mark.parametrize(
    ("width", "height"), [(420, 800), *(pytest.param(*size, marks=pytest.mark.slow) for size in WIDER)]
)
def test_controls_are_within_reach_on_every_screen(opened: Any, width: int, height: int) -> None:
    run = pn.simulate(pn.load("solo12_standing"), 0.1, record=("forces", "energy"))
    page = opened(run)
    page.page.set_viewport_size({"width": width, "height": height})
    for name in ("#play", "#loop", "#plots-toggle", "#speed", "#timeline", "#follow"):
        box = page.page.locator(name).bounding_box()
        assert box["x"] >= 0.0, name
        assert box["x"] + box["width"] <= width + 1, name
        assert 0.0 <= box["y"] <= height - box["height"] + 1, name
    page.page.locator("#plots canvas").first.scroll_into_view_if_needed()
    canvas = page.page.locator("#plots canvas").first.bounding_box()
    assert canvas["y"] < height
    assert page.page.locator("#scene").bounding_box()["height"] >= 0.3 * height


def test_every_kind_of_event_and_mode_has_its_own_color() -> None:
    kinds = {kind.name for kind in core.EventKind}
    assert kinds <= set(EVENTS)
    for table in (EVENTS, MODES):
        colors = [look[0] for look in table.values()]
        assert len(set(colors)) == len(colors)
    assert len(set(FORCES.values())) == len(FORCES)


def luminance(color: str) -> float:
    """Relative luminance of "#rrggbb" or "rgb(r,g,b)" [WCAG 2.2]."""
    if color.startswith("#"):
        parts = [int(color[k : k + 2], 16) for k in (1, 3, 5)]
    else:
        parts = [int(x) for x in color.strip("rgb()").split(",")]
    linear = [x / 12.92 if x <= 0.04045 else ((x + 0.055) / 1.055) ** 2.4 for x in np.array(parts) / 255.0]
    return float(np.dot([0.2126, 0.7152, 0.0722], linear))


@pytest.mark.parametrize("scheme", ["light", pytest.param("dark", marks=pytest.mark.slow)])
def test_curves_are_seen_on_their_paper(opened: Any, scheme: str) -> None:
    model = jointed(*[pin.JointModelRZ()] * 8)
    page = opened(run_of(model, np.linspace(0.0, 1.0, 9), lambda t: t * np.arange(8.0)))
    page.page.emulate_media(color_scheme=scheme)
    page.run("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    paper = page.run("() => getComputedStyle(document.documentElement).getPropertyValue('--paper').trim()")
    swatches = page.run("""() => [...document.querySelectorAll(".plot li button")].map(
      (button) => button.style.getPropertyValue("--swatch"))""")
    assert len(set(swatches)) == 8
    for color in swatches:
        bright, dim = sorted((luminance(color), luminance(paper)), reverse=True)
        assert (bright + 0.05) / (dim + 0.05) > 4.5, (color, paper)


@pytest.mark.slow
def test_on_a_phone_names_of_modes_and_bands_are_whole(opened: Any) -> None:
    page = opened(pn.simulate(pn.load("panda_friction"), 0.3, record="forces"))
    page.page.set_viewport_size({"width": 420, "height": 800})
    page.run("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    legend, tools = (page.page.locator(name).bounding_box() for name in ("#legend", "#transport"))
    assert legend["width"] > 0.9 * tools["width"]
    assert legend["height"] < 50
    # The longest name fits into the room left of the bands: none is cut.
    assert page.run("() => replay.margin") > page.run(
        """() => { const c = document.createElement("canvas").getContext("2d");
        c.font = "11px " + getComputedStyle(document.documentElement).fontFamily;
        return c.measureText("panda_joint7").width; }"""
    )


@pytest.mark.slow
def test_on_a_short_screen_curves_are_seen_and_the_heading_is_beside_the_robot(opened: Any) -> None:
    scene = pn.load("four_bar")
    runs = [pn.simulate(scene, 1.0, output_dt=0.01, record=("forces", "energy")) for _ in range(2)]
    page = opened(runs)
    page.page.set_viewport_size({"width": 900, "height": 500})
    page.run("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    curves = page.page.locator("#plots canvas").first.bounding_box()
    assert curves["y"] + curves["height"] <= 501
    heading = page.page.locator("#heading").bounding_box()
    tops = [
        page.run("t => { replay.seek(t); return replay.box()[1]; }", float(t)) for t in np.linspace(0, 1, 11)
    ]
    assert min(tops) >= heading["y"] + heading["height"]


@pytest.mark.slow
def test_numbers_do_not_cover_each_other(opened: Any) -> None:
    page = opened(pn.simulate(pn.load("four_bar"), 1.0, output_dt=0.01, record=("forces", "energy")))
    for time in (0.2, 0.5, 0.8):
        page.run("t => replay.seek(t)", time)
        boxes = page.run("""() => [...document.querySelectorAll("#labels span")]
          .filter((span) => span.style.visibility !== "hidden" && span.textContent)
          .map((span) => span.getBoundingClientRect())
          .map(({ left, top, right, bottom }) => [left, top, right, bottom])""")
        assert len(boxes) >= 4, time
        for i, (left, top, right, bottom) in enumerate(boxes):
            for other in boxes[:i]:
                assert left >= other[2] or right <= other[0] or top >= other[3] or bottom <= other[1]
