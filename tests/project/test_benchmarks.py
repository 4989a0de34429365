"""Every part of the benchmarks runs in its smallest form; results, report and README agree.

No time is asserted: machines differ, and others use them.
"""

from __future__ import annotations

import json
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

pytest.importorskip("matplotlib")

ROOT = Path(__file__).resolve().parents[2]
REACHED = 1e-9  # [rad] by our finest runs: goal of the Coulomb pendulum
ENERGY = 1e-5  # [J] of about 8 J, after two seconds at a tolerance of 1e-9
GAP = 1e-12  # [m]: loops of one meter closed to rounding


@pytest.fixture(autouse=True)
def _checkout(monkeypatch: pytest.MonkeyPatch) -> None:
    """The benchmarks are no part of the installed package: they are found in the checkout."""
    monkeypatch.syspath_prepend(str(ROOT))


@pytest.fixture
def command() -> ModuleType:
    from benchmarks import command

    return command


def results(command: ModuleType, folder: Path, part: str, *words: str) -> Any:
    """Runs a part quickly; its results."""
    assert command.main([part, "--quick", "--output", str(folder), *words]) == 0
    assert (folder / f"{part}.md").read_text(encoding="utf-8").startswith("## ")
    record = json.loads((folder / f"{part}.json").read_text(encoding="utf-8"))
    assert record["part"] == part
    assert record["quick"] is True
    return record["results"]


def test_evaluation(command: ModuleType, tmp_path: Path) -> None:
    (row,) = results(command, tmp_path, "evaluation", "--only", "four_bar")
    assert (row["nv"], row["rows"]) == (3, 2)
    assert row["seconds"]["pin_nonideal"] > 0.0


def test_results_of_other_cases_are_kept(command: ModuleType, tmp_path: Path) -> None:
    for name in ("four_bar", "panda", "four_bar"):
        found = results(command, tmp_path, "evaluation", "--only", name)
    assert [row["case"] for row in found] == ["four_bar", "panda"]


def test_scaling(command: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from benchmarks import scaling

    monkeypatch.setattr(scaling, "QUICK", (1, 2))
    monkeypatch.setattr(scaling, "FIT_FROM", 1)
    found = results(command, tmp_path, "scaling")
    assert [(row["N"], row["status"]) for row in found["sizes"]] == [(1, "ok"), (2, "ok")]
    assert np.isfinite(found["exponents"]["pin_nonideal"])
    assert (tmp_path / "benchmarks" / "scaling.svg").is_file()


@pytest.mark.parametrize("case", ["chains", "motions", "rings", "forests", "slipping", "short"])
def test_growth(command: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, case: str) -> None:
    from benchmarks import growth

    monkeypatch.setattr(growth, "LONG_RUN", 1e-3)
    (found,) = results(command, tmp_path, "growth", "--only", case)
    assert found["case"] == case
    for row in found["rows"]:
        assert all(seconds > 0.0 for seconds in row["seconds"].values())
        assert all(error < REACHED for error in row["errors"].values())
    assert (tmp_path / "benchmarks" / "growth.svg").is_file()


def test_a_size_that_fails_is_recorded(monkeypatch: pytest.MonkeyPatch) -> None:
    from benchmarks import scaling

    monkeypatch.setattr(scaling, "QUICK", (0, 1))
    failed, done = scaling.measure(True)["sizes"]
    assert failed["status"].startswith("failed: InputError: n_four_bar: N must be ")
    assert "seconds" not in failed
    assert done["status"] == "ok"


def test_the_exponent_is_that_of_a_power() -> None:
    from benchmarks import scaling, timing

    small, large = timing.Times([1.0, 2.0, 1.0]), timing.Times([8.0, 16.0, 80.0])
    assert scaling.exponent(small, large, 4.0) == pytest.approx(1.5)


def test_accuracy(command: ModuleType, tmp_path: Path) -> None:
    (found,) = results(command, tmp_path, "accuracy", "--only", "coulomb_pendulum", "--peers", "none")
    assert {row["tool"] for row in found["runs"]} == {"pin_nonideal"}
    assert min(row["error"] for row in found["runs"]) < REACHED
    assert all("seconds" in entry["tools"]["pin_nonideal"] for entry in found["levels"])
    assert (tmp_path / "benchmarks" / "accuracy.svg").is_file()


def test_the_compiled_loop_states_what_it_can() -> None:
    from benchmarks import problems
    from benchmarks.tools import TOOLS

    tool = TOOLS["pin+odeint"]
    assert not tool.settings(problems.problem("coulomb_pendulum"))
    assert not tool.settings(problems.problem("solo12"))
    problem = problems.problem("four_bar")
    chosen = [s for s in tool.settings(problem) if s.label == "rtol 1e-09"]
    assert [s.family for s in chosen] == ["fehlberg78", "dopri5", "bulirsch_stoer"]
    if reason := tool.missing():
        pytest.skip(reason)
    for setting in chosen:
        found = tool.prepare(problem, setting, problems.SAMPLES)()
        assert problem.error(found.q) < 1e4 * setting.values["rtol"]


def test_features(command: ModuleType, tmp_path: Path) -> None:
    found = results(command, tmp_path, "features")
    assert [row["feature"] for row in found["added"]][:2] == ["open chains, nothing else", "+ loop (2 rows)"]
    assert len(found["absent"]) >= 3


def test_contacts(command: ModuleType, tmp_path: Path) -> None:
    found = results(command, tmp_path, "contacts", "--only", "bouncing")
    (bouncing,) = found["curves"]
    errors = {row["setting"]: row["error"] for row in bouncing["runs"] if row["tool"] == "pin_nonideal"}
    assert errors["dop853 rtol 1e-08"] < GAP
    assert errors["moreau h 1e-03"] < errors["moreau h 1e-02"]
    assert {row["contacts"] for row in found["impacts"]} == {1, 2, 4, 8}
    assert {row["method"] for row in found["open"]} == {"dop853", "moreau"}


@pytest.mark.parametrize("name", ["sliding", "standing"])
def test_closed_forms_of_contacts(name: str) -> None:
    from benchmarks import contacts

    case = contacts.CASES[name]()
    run = contacts.ours(case, ())[2]
    np.testing.assert_allclose(run.run(), case.end, atol=GAP)


def test_a_soft_contact_has_the_damping_of_its_restitution() -> None:
    from benchmarks.contact_rivals import damping_ratio

    for restitution in (0.2, 0.8):
        damping = 2.0 * damping_ratio(restitution)

        def swing(t: float, x: Any, damping: float = damping) -> Any:
            return [x[1], -x[0] - damping * x[1]]

        def lets_go(t: float, x: Any, damping: float = damping) -> float:
            return float(-x[0] - damping * x[1]) if t else -1.0

        lets_go.terminal = True  # type: ignore[attr-defined]
        run = solve_ivp(swing, (0.0, 10.0), [0.0, 1.0], events=lets_go, rtol=1e-10, atol=1e-12)
        assert run.y[1, -1] == pytest.approx(-restitution, abs=1e-8)


@pytest.mark.parametrize(("name", "gap"), [("sliding", 2e-3), ("standing", 1e-4)])  # first order in the step
def test_rivals_of_contacts_come_near_the_closed_forms(name: str, gap: float) -> None:
    from benchmarks import contacts
    from benchmarks.tools import TOOLS

    case = contacts.CASES[name]()
    makers = {tool: make for tool, make in contacts.RIVALS.items() if TOOLS[tool].missing() is None}
    assert "mujoco" in makers
    for tool, make in makers.items():
        (run,) = make(case, [1e-3])
        assert run.tool == tool
        np.testing.assert_allclose(run.run(), case.end, atol=gap)


def test_batches(command: ModuleType, tmp_path: Path) -> None:
    (found,) = results(command, tmp_path, "batches", "--only", "four_bar")
    ours = [row for row in found["rows"] if row["tool"] == "pin_nonideal"]
    assert [(row["threads"], row["status"]) for row in ours] == [(1, "ok"), (2, "ok")]


def test_long(command: ModuleType, tmp_path: Path) -> None:
    (found,) = results(command, tmp_path, "long", "--only", "four_bar", "--peers", "none")
    rows = {row["setting"]: row for row in found["rows"]}
    assert all(row["status"] == "ok" and row["gap"] < GAP for row in rows.values())
    assert abs(rows["dop853 rtol 1e-09"]["energy_change"]) < ENERGY


def test_gap_and_energy_are_those_of_the_state() -> None:
    from benchmarks import long, problems

    problem = problems.problem("four_bar")
    assert long.gap(problem, problem.q0) < GAP
    opened = problem.q0.copy()
    opened[-1] += 0.1
    assert long.gap(problem, opened) > 0.01
    v = problem.v0
    kinetic = 0.5 * v @ pin.crba(problem.model, problem.model.createData(), problem.q0) @ v
    moving, still = (long.energy(problem, problem.q0, rate) for rate in (v, 0.0 * v))
    assert moving - still == pytest.approx(kinetic, rel=1e-12)


def test_footprint(command: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from benchmarks import footprint

    monkeypatch.setattr(footprint, "MODULES", {"numpy": "numpy", "none": "no_such_module"})
    (row,) = results(command, tmp_path, "footprint")
    assert row["tool"] == "numpy"
    assert row["import_bytes"] > 0


def test_an_unknown_part_is_named(command: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        command.main(["evalution"])
    assert "no part 'evalution'; there are evaluation, scaling, " in capsys.readouterr().err


def test_references_belong_to_the_problems() -> None:
    from benchmarks import problems, reference_store

    stale = [name for name in problems.MAKERS if reference_store.read(problems.problem(name)) is None]
    assert stale == []


# --- rivals -------------------------------------------------------------------------------------------------


def test_a_rival_that_diverges_and_resets_is_marked() -> None:
    pytest.importorskip("mujoco")
    from benchmarks import accuracy, problems
    from benchmarks.tools import TOOLS, Setting

    problem = problems.problem("panda")
    coarse = Setting("Euler", "h 2e-02", 50, {"integrator": "Euler", "stiff": False})
    outcome = TOOLS["mujoco"].prepare(problem, coarse)()
    assert outcome.failure == "diverged (mjWARN_BADQACC)"
    assert outcome.steps < 50
    judged = accuracy.judged(problem, outcome)
    assert judged == {"steps": outcome.steps, "error": None, "status": f"failed: {outcome.failure}"}


def test_mujoco_has_the_same_mechanics_of_a_floating_base() -> None:
    mujoco = pytest.importorskip("mujoco")
    from benchmarks import problems
    from benchmarks.tools.mujoco import Coordinates, states

    problem = problems.problem("solo12")
    model, generator = problem.model, np.random.default_rng(3)
    q = pin.integrate(model, problem.q0, 0.3 * generator.standard_normal(model.nv))
    v = generator.standard_normal(model.nv)
    mj = states(problem)
    coordinates = Coordinates(model, mj)
    data = mujoco.MjData(mj)
    data.qpos[:], data.qvel[:] = coordinates.there(q, v)
    back = coordinates.back(data.qpos, data.qvel)
    assert np.abs(pin.difference(model, q, back[0])).max() < 1e-14
    assert np.abs(v - back[1]).max() < 1e-14
    mujoco.mj_forward(mj, data)
    mujoco.mj_energyVel(mj, data)
    ours = model.createData()
    kinetic = pin.computeKineticEnergy(model, ours, q, v)
    # MJCF rods are thickened by a part in a million of their largest moment.
    assert data.energy[1] == pytest.approx(kinetic, rel=1e-5)


# --- key figures and report ---------------------------------------------------------------------------------


def test_key_figures_take_the_fastest_rival_that_got_there() -> None:
    from benchmarks import goals

    tools = {
        "pin_nonideal": {"seconds": 1.0, "setting": "a", "error": 1e-9},
        "slow": {"seconds": 9.0, "ratio": 9.1, "setting": "b"},
        "fast": {"seconds": 3.0, "ratio": 3.1, "setting": "c"},
        "lost": {"best_error": 0.1},
    }
    figure = goals.times_faster("x", tools, 2.0)
    assert (figure.title, figure.value, figure.met) == ("x (fast, c)", 3.1, True)
    assert not goals.times_faster("x", tools, 5.0).met
    nobody = goals.times_faster("x", tools, 2.0, "lost")
    assert (nobody.value, nobody.met, nobody.shown) == (None, True, "no rival got there in the time limit")
    assert not goals.times_faster("x", {"slow": tools["slow"]}, 2.0).met
    absent = goals.times_faster("x", tools, 2.0, "nobody measured it")
    assert (absent.value, absent.met, absent.shown) == (None, False, "not measured")
    assert goals.earlier("x", tools, tools).value == 3.0


def test_a_setting_that_is_fastest_in_turns_wins_whatever_its_rough_time_was() -> None:
    from benchmarks import accuracy, timing

    rough = {"a": 1.0, "b": 1.1, "c": 1.3, "d": 1.4, "slow": 2.0}
    rows = [{"tool": "T", "setting": k, "error": 1e-7, "seconds": x} for k, x in rough.items()]
    rows += [{"tool": "T", "setting": "coarse", "error": 1e-5, "seconds": 0.1}]
    rows += [{"tool": "other", "setting": "a", "error": 1e-9, "seconds": 0.5}]
    racing = accuracy.entrants(rows, "T", 1e-6)
    assert [row["setting"] for row in racing] == ["a", "b", "c"]
    # Slow moments hit all alike: b is faster in two rounds of three, though a has the least time of all.
    turns = {("T", 0): [2.0, 4.0, 0.5], ("T", 1): [1.8, 3.6, 0.6], ("T", 2): [2.2, 4.4, 0.7]}
    assert accuracy.winner({k: timing.Times(x) for k, x in turns.items()}, "T", 3) == 1


def test_a_floor_is_seen_and_one_lucky_setting_is_none() -> None:
    from benchmarks.accuracy import has_met_its_floor

    assert has_met_its_floor([1e-3, 1e-5, 1.1e-5, 0.9e-5, 1e-5, 0.8e-5, 1.2e-5])
    assert not has_met_its_floor([2e-4, 6e-5, 1e-6, 6e-6, 4e-6, 2e-6])  # the third one was luck
    assert not has_met_its_floor([1.0, 1.1, 1.0, 0.9, 1.0, 1.0])
    assert not has_met_its_floor([1e-5, 1e-5, 1e-5])


def test_the_curve_of_a_tool_joins_what_nobody_faster_beats() -> None:
    from benchmarks.plots import lower_front

    assert lower_front([(3.0, 1e-3), (1.0, 1e-1), (2.0, 1e-4)]) == [(1.0, 1e-1), (2.0, 1e-4)]


def test_the_page_and_the_readme_are_those_of_the_recorded_results() -> None:
    from benchmarks import report

    records = report.read(report.RECORDED)
    assert set(records) == set(report.SECTIONS)
    assert not any(record["quick"] for record in records.values())
    assert report.DOCUMENT.read_text(encoding="utf-8") == report.document(records)
    shown = report.README.read_text(encoding="utf-8").split(report.BEGIN)[1].split(report.END)[0]
    assert shown == report.readme_sentences(records)


def test_the_report_keeps_full_runs_only(
    command: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from benchmarks import report

    recorded = report.read(report.RECORDED)
    output, kept = tmp_path / "output", tmp_path / "kept"
    output.mkdir()
    for name, quick in (("evaluation", False), ("footprint", True)):
        (output / f"{name}.json").write_text(json.dumps(recorded[name] | {"quick": quick}), encoding="utf-8")
    for name, path in (
        ("RECORDED", kept),
        ("DOCUMENT", tmp_path / "page.md"),
        ("PICTURES", tmp_path / "pictures"),
    ):
        monkeypatch.setattr(report, name, path)
    monkeypatch.setattr(report, "README", tmp_path / "README.md")
    report.README.write_text(f"before\n{report.BEGIN}old\n{report.END}after\n", encoding="utf-8")
    assert command.main(["report", "--output", str(output)]) == 0
    assert [path.name for path in kept.iterdir()] == ["evaluation.json"]
    page = report.DOCUMENT.read_text(encoding="utf-8")
    assert "## Cost of an evaluation" in page
    assert "## Import" not in page
    text = report.README.read_text(encoding="utf-8")
    assert text.startswith("before\n")
    assert text.endswith("after\n")
    assert "old" not in text


def test_series_that_coincide_are_told_apart_in_the_pictures() -> None:
    """Two equal series over N: the color of each is visible along the line, and all styles differ."""
    import io

    from PIL import Image

    from benchmarks import plots

    sizes = [{"N": n, "seconds": {"first": 1e-6 * n, "second": 1e-6 * n}} for n in (1, 4, 16, 64)]
    figure = plots.scaling({"sizes": sizes})
    figure.axes[0].get_legend().remove()
    stream = io.BytesIO()
    figure.savefig(stream, dpi=150)
    picture = np.asarray(Image.open(stream).convert("RGB")).astype(int)
    for color in ((31, 119, 180), (255, 127, 14)):
        assert np.count_nonzero(np.abs(picture - color).max(axis=2) < 40) > 300
    looks = [plots.look(k, 8) for k in range(8)]
    assert len({(one["marker"], one["markersize"], one["linewidth"]) for one in looks}) == 8
