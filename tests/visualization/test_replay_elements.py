"""Friction in the replay: modes in their colors, shares of the limit, cones with the force inside."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.validation import unit_axis
from pin_nonideal.visualization.page.contact_points import contact_points
from pin_nonideal.visualization.page.force_arrows import arrows_of
from pin_nonideal.visualization.page.frames import sample
from pin_nonideal.visualization.page.friction_glyphs import elements_of
from pin_nonideal.visualization.page.markers import marks_of
from pin_nonideal.visualization.page.mode_timeline import bands_of
from pin_nonideal.visualization.page.payload import packed_runs
from pin_nonideal.visualization.page.style import MODES

from ..support.replay_browser import Watched, headless_browser
from ..support.replay_runs import add_frame, jointed

MASS, MU, G = 1.0, 0.4, 9.81


@pytest.fixture(scope="module")
def sliding() -> Any:
    """A particle on the floor that slides at 2 m/s until friction stops it after 2 / (mu g) = 0.51 s."""
    model = jointed(pin.JointModelTranslation(), lever=0.0)
    add_frame(model, "foot", 1, [0.0, 0.0, 0.0])
    scene = pn.Scene(model, contacts=[pn.PointContact("foot", mu=MU, name="foot")])
    return pn.simulate(
        scene, 1.0, v=np.array([2.0, 0.0, 0.0]), record=("forces", "reactions"), output_dt=0.01
    )


def parts(run: Any) -> tuple[Any, Any, Any]:
    motion, marks = sample(run), marks_of(run.scene._compiled)
    touches = contact_points(run, motion)
    return motion, elements_of(run, motion, marks, touches), arrows_of(run, motion, touches)


def test_the_force_of_a_contact_lies_on_its_cone_while_it_slides(sliding: Any) -> None:
    motion, (element,), arrows = parts(sliding)
    assert element.mu == MU
    (force,) = [arrow for arrow in arrows if arrow.name == "foot"]
    slides = motion.times < 2.0 / (MU * G) - 0.02
    rests = motion.times > 2.0 / (MU * G) + 0.02
    np.testing.assert_allclose(force.values[slides], np.tile([-MU * G, 0.0, G], (slides.sum(), 1)), atol=1e-6)
    np.testing.assert_allclose(force.values[rests], np.tile([0.0, 0.0, G], (rests.sum(), 1)), atol=1e-6)
    np.testing.assert_allclose(element.share[slides], 1.0, atol=1e-6)
    np.testing.assert_allclose(element.share[rests], 0.0, atol=1e-6)
    np.testing.assert_allclose(element.normal, G, atol=1e-6)


def test_a_pair_of_shapes_has_one_arrow_and_one_band() -> None:
    """A box slides to rest: its force acts at the center of pressure, and each corner has its own cone."""
    model, shapes, edge, mass, speed = pin.Model(), pin.GeometryModel(), 0.2, 4.0, 1.0
    place = (0.0, 0.0, 0.5 * edge)
    pn.free_body(model, "box", coal.Box(edge, edge, edge), mass=mass, collision_model=shapes, place=place)
    scene = pn.Scene(model, contacts=pn.ground_contacts(model, shapes, mu=MU), collision_model=shapes)
    v = [speed, 0.0, 0.0, 0.0, 0.0, 0.0]
    run = pn.simulate(scene, 0.5, v=v, record=("forces", "energy"), output_dt=0.01)
    rest = speed / (MU * G)
    assert [(event.kind, event.element) for event in run.events] == [("stick", "box on ground")]
    assert run.events[0].time == pytest.approx(rest, abs=1e-9)
    ((name, band),) = bands_of(run)
    assert (name, [mode for _, _, mode in band]) == ("box on ground", [1, 0])
    motion, elements, (arrow,) = parts(run)
    slides = motion.times < rest - 0.02
    along = np.tile([-MU, 0.0, 1.0], (slides.sum(), 1))
    np.testing.assert_allclose(arrow.values[slides], mass * G * along, atol=1e-9)
    assert arrow.name == "box on ground"
    ahead = arrow.origin - motion.q[:, :3] - [0.0, 0.0, 0.5 * edge]
    before = np.tile([0.5 * MU * edge, 0.0, -0.5 * edge], (slides.sum(), 1))
    np.testing.assert_allclose(ahead[slides], before, atol=1e-9)
    np.testing.assert_allclose(ahead[motion.times > rest + 0.02, :2], 0.0, atol=1e-7)
    assert [element.contact for element in elements] == ["box on ground"] * 4
    np.testing.assert_allclose(sum(element.normal for element in elements), mass * G, rtol=1e-9)
    for element in elements:
        np.testing.assert_allclose(element.share[slides], 1.0, atol=1e-6)
    content = packed_runs([run], ["run"], None, "title", None, True)
    header = json.loads(content[4 : 4 + int.from_bytes(content[:4], "little")])
    assert [(mode["name"], mode["point"]) for mode in header["modes"][:1]] == [("box on ground", False)]
    assert [mode["point"] for mode in header["modes"][1:]] == [True] * 4
    assert {mark["contact"] for mark in header["marks"]} == {"box on ground"}
    assert header["events"]["elements"] == ["box on ground"]


def test_friction_in_a_joint_has_its_share_of_the_limit() -> None:
    run = pn.simulate(pn.load("belt_oscillator"), 2.0, output_dt=0.01, record="forces")
    motion, (element,), _ = parts(run)
    joint = run.scene.model.getJointId("slip")
    assert (element.joint, element.name) == (joint, "rubbing")
    # While it sticks the spring's pull grows from zero to the static limit of 8 N at 0.1 m/s and 100 N/m.
    sticks = motion.times < 0.79
    np.testing.assert_allclose(element.share[sticks], 10.0 * motion.times[sticks] / 8.0, atol=1e-6)


def test_friction_in_a_hinge_is_drawn_about_its_axis() -> None:
    """The pin of the rough four-bar, as Pinocchio places the axis of its frame."""
    run = pn.simulate(pn.load("rough_four_bar"), 0.05)
    anchor = next(item for item in run.scene.constraints if isinstance(item, pn.HingeAnchor))
    _, elements, _ = parts(run)
    (element,) = [x for x in elements if np.linalg.norm(x.point) > 0.0]
    frame = run.scene.model.frames[run.scene.model.getFrameId(anchor.frame1)]
    np.testing.assert_allclose(element.point, frame.placement.translation, atol=1e-12)
    np.testing.assert_allclose(
        element.axis, frame.placement.rotation @ unit_axis("", anchor.axis), atol=1e-12
    )


def test_runs_without_records_have_modes_only() -> None:
    run = pn.simulate(pn.load("belt_oscillator"), 0.2)
    _, (element,), _ = parts(run)
    assert element.share is None


@pytest.fixture(scope="module")
def page(sliding: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Watched]:
    path = pn.replay(sliding, tmp_path_factory.mktemp("sliding") / "sliding.html")
    with headless_browser() as browser:
        watched = Watched(browser, path)
        yield watched
        assert watched.complaints == []
        watched.close()


def test_rings_take_the_color_of_the_mode(page: Watched) -> None:
    def colors(time: float) -> set[str]:
        return set(page.run("t => { replay.seek(t); return replay.ringColors(0); }", time))

    slip, stick = MODES[1][0], MODES[0][0]
    assert slip in colors(0.2)
    assert colors(0.2) == {slip}  # all of the limit is used
    assert stick in colors(0.9)
    assert len(colors(0.9)) == 2  # it rests without friction: one piece of the ring, the rest is light


def test_the_cone_is_drawn_and_can_be_hidden(page: Watched) -> None:
    shown = page.picture(0.9)
    page.run("() => replay.show('elements', false)")
    hidden = page.picture(0.9)
    page.run("() => replay.show('elements', true)")
    assert np.count_nonzero(np.abs(shown - hidden).max(axis=2) > 8) > 300


@pytest.mark.parametrize("forces", [True, False])
def test_a_page_without_forces_has_no_cones(sliding: Any, forces: bool) -> None:
    """The height of a cone is the normal force; the ring of the mode needs no force."""
    content = packed_runs([sliding], ["run"], None, "title", None, forces)
    header = json.loads(content[4 : 4 + int.from_bytes(content[:4], "little")])
    (element,) = header["elements"]
    assert (element["normal"] is not None) is forces
    assert element["share"] is not None
    assert bool(header["arrows"]) is forces


def test_pictures_and_videos_are_taken_in_the_page(page: Watched) -> None:
    import base64
    import io

    from PIL import Image

    page.run("() => replay.seek(0.3)")
    picture = Image.open(io.BytesIO(base64.b64decode(page.run("() => replay.picture()"))))
    box = page.page.locator("#scene").bounding_box()
    assert picture.size == (int(box["width"]), int(box["height"]))
    assert len(picture.convert("RGB").getcolors(1 << 24)) > 200
    page.page.locator("#speed").select_option("1")
    video = base64.b64decode(page.run("() => replay.video(10)"))
    assert video[:4] == b"\x1aE\xdf\xa3"  # EBML, as WebM begins
    assert len(video) > 2000
    with page.page.expect_download() as download:
        page.page.locator("#picture").click()
    assert download.value.suggested_filename.endswith(".png")
