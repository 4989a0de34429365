"""Table of the models that load, and of their correctness, over folders of URDF and MJCF files.

    python -m benchmarks.models FOLDER ... [--write docs/reference/models.md]

Each folder is a row.  "example-robot-data" stands for the robots of that package.  A right model agrees with
the reference at random consistent states.  The reference of MJCF is MuJoCo's M, bias, actuator forces and
accelerations, with exact equalities and without contacts and limits.  The reference of URDF is Pinocchio's
articulated-body acceleration.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
import pinocchio as pin

import pin_nonideal as pn
from oracles import mujoco_motion
from pin_nonideal.loading.mjcf.compile import compile_mjcf

RIGHT = 1e-9  # tolerance of M, forces and accelerations, relative to 1 + the largest entry
ROUNDED = 1e-5  # tolerance of accelerations of loops with rounded frames in the file
STATES = 2
QUOTED = re.compile(r'"[^"]*"')
SPREAD = 0.3  # spread of the states around the reference [m or rad]
MANY, CLOSE = 20, 1e-3  # spread CLOSE above MANY constraints: projection from far takes minutes
DENSITY = 1000.0  # density of links without inertia [kg/m^3]


class Verdict(NamedTuple):
    """Result of one file.

    Attributes:
        kind: "right", "wrong", "refused" or "no model" (fragments that MuJoCo itself refuses).
        help: "", or the option that loading needed: "density", "allow".
        words: error message, or size of the difference.
        notes: number of notes.
    """

    kind: str
    help: str
    words: str
    notes: int


def main(arguments: list[str]) -> int:
    """Print or write the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.models", description=__doc__.splitlines()[0])
    parser.add_argument("folders", nargs="+", metavar="FOLDER")
    parser.add_argument("--write", type=Path, metavar="FILE", help="file of the page (default: printed)")
    options = parser.parse_args(arguments)
    rows, details = [], []
    for folder in options.folders:
        found = {}
        for name in models_in(folder):
            found[name] = verdict(name)
            print(
                found[name].kind, found[name].help, name, found[name].words[:150], file=sys.stderr, flush=True
            )
        name = Path(folder).name
        rows.append(row(name, list(found.values())))
        details += detail(name, found)
    page = "\n".join([HEAD, *rows, "", *details]) + "\n"
    if options.write is None:
        print(page)
    else:
        options.write.write_text(page, encoding="utf-8")
    return 0


HEAD = f"""# Models of others

`python -m benchmarks.models FOLDER ...` writes this page. It loads models that others have written and
compares them with MuJoCo (MJCF) or Pinocchio (URDF) at {STATES} random states. The columns count files:

- *No model*: fragments that MuJoCo refuses by itself.
- *Loads*: files that load without arguments.
- *With help*: files that load with `density=1000.0` (for links without inertia) or with `allow=` (for
  unsupported features). With `allow=` the comparison covers M and the bias forces only.
- *Right*: files with the mass matrix, bias forces, actuator forces and accelerations of MuJoCo, or with the
  accelerations of Pinocchio, to {RIGHT:g}. The accelerations of files with rounded loops agree to
  {ROUNDED:g}.
- *Wrong*: files that load and differ.
- *Refused*: files that end in an error. Copies of such sets often lack large files, and a body whose mass
  comes from a missing mesh is refused.

The last column is the mean number of notes of a file.

| models | files | no model | loads | with help | right | wrong | refused | notes a file |
| --- | --- | --- | --- | --- | --- | --- | --- | --- |"""


def models_in(folder: str) -> Iterator[str]:
    """Yield paths of the models in a folder, or names of example-robot-data."""
    if folder == "example-robot-data":
        from example_robot_data import robots_loader

        yield from sorted(robots_loader.ROBOTS)
        return
    for path in sorted(Path(folder).rglob("*")):
        text = path.suffix == ".xml" and path.is_file() and path.read_text(encoding="utf-8", errors="ignore")
        if (path.suffix == ".urdf" and path.is_file()) or (text and re.search(r"<mujoco[\s>]", text)):
            yield str(path)


def verdict(name: str) -> Verdict:
    """Load one file and compare the scene with its reference."""
    try:
        scene, needed = loaded(name)
    except pn.PinNonidealError as error:
        words = " ".join(str(error).replace(f'"{name}"', "").split()).strip(": ")
        lost = "cannot be compiled by MuJoCo" in words or "cannot be read by MuJoCo" in words
        return Verdict("no model" if lost else "refused", "", words, 0)
    except Exception as error:
        return Verdict("wrong", "", f"{type(error).__name__}: {error}", 0)
    try:
        apart = differences(name, scene, needed == "allow")
    except Exception as error:
        return Verdict("wrong", needed, " ".join(str(error).split()), len(scene.notes))
    rounded = any("tolerance of the assembly" in note for note in scene.notes)
    right = apart <= (ROUNDED if rounded else RIGHT)
    return Verdict("right" if right else "wrong", needed, f"off by {apart:.1e}", len(scene.notes))


def loaded(name: str) -> tuple[pn.Scene, str]:
    """Return the scene, and the option that loading needed."""
    try:
        return pn.load(name), ""
    except pn.PinNonidealError as error:
        if "density=1000.0" in str(error):
            return pn.load(name, density=DENSITY), "density"
        allow = re.search(r"allow=\(([^)]*)\)", str(error))
        if allow is None:
            raise
        return pn.load(name, allow=tuple(re.findall(r"'(\w+)'", allow[1]))), "allow"


def differences(name: str, scene: pn.Scene, partly: bool) -> float:
    """Return the largest difference relative to the largest entry, over STATES random states."""
    if scene.model.nv == 0:
        return 0.0
    rng, worst = np.random.default_rng(1), 0.0
    compiled = reference(name) if name.endswith(".xml") else None
    for _ in range(STATES):
        worst = max(worst, of_mjcf(scene, compiled, rng, partly) if compiled else of_urdf(scene, rng))
    return worst


def reference(path: str) -> object:
    """Return MuJoCo's model of a file with its meshes, or the scene's model if meshes are missing."""
    try:
        return mujoco.MjModel.from_xml_path(path)
    except ValueError:
        return compile_mjcf(Path(path)).model


def of_mjcf(scene: pn.Scene, compiled: object, rng: np.random.Generator, partly: bool) -> float:
    """Compare M, bias, actuator forces and accelerations with MuJoCo's."""
    spread = SPREAD if len(scene.constraints) <= MANY else CLOSE
    qpos, qvel = mujoco_motion.random_state(compiled, rng, spread)
    if scene.constraints:
        start = mujoco_motion.instant(compiled, qpos, qvel)
        qpos, qvel = mujoco_motion.mujoco_state(compiled, *scene.project(start.q, start.v))
    ctrl = rng.uniform(-1.0, 1.0, compiled.nu)
    theirs = mujoco_motion.instant(compiled, qpos, qvel, ctrl)
    M = pin.crba(scene.model, scene.model.createData(), theirs.q)
    nle = pin.nonLinearEffects(scene.model, scene.model.createData(), theirs.q, theirs.v)
    pairs = [(np.triu(M) + np.triu(M, 1).T, theirs.M), (nle, theirs.bias)]
    if scene.actuation is not None and not partly:
        scene.actuation.set_control(ctrl)
        pairs.append((scene.actuation(0.0, theirs.q, theirs.v), theirs.actuator))
    if not partly:
        pairs.append((scene.solve(theirs.q, theirs.v).a, theirs.a))
    return max(float(np.abs(a - b).max() / (1.0 + np.abs(b).max())) for a, b in pairs)


def of_urdf(scene: pn.Scene, rng: np.random.Generator) -> float:
    """Compare the core's free accelerations with Pinocchio's articulated-body algorithm."""
    model = scene.model
    free = pn.Scene(model, q0=scene.q0)
    q = pin.integrate(model, scene.q0, 0.3 * rng.uniform(-1.0, 1.0, model.nv))
    v, tau = rng.uniform(-1.0, 1.0, model.nv), rng.uniform(-1.0, 1.0, model.nv)
    theirs = pin.aba(model, model.createData(), q, v, tau)
    ours = free.acceleration(q, v, tau)
    M = pin.crba(model, model.createData(), q)
    M = np.triu(M) + np.triu(M, 1).T
    return float(np.abs(M @ (ours - theirs)).max() / (np.abs(M @ theirs).max() + 1.0))


def row(name: str, verdicts: list[Verdict]) -> str:
    """Return a row of the table."""
    kinds, total = Counter(v.kind for v in verdicts), len(verdicts)
    models = total - kinds["no model"]
    as_is = sum(v.kind in ("right", "wrong") and not v.help for v in verdicts)
    helped = sum(v.kind in ("right", "wrong") and bool(v.help) for v in verdicts)
    notes = np.mean([v.notes for v in verdicts if v.kind in ("right", "wrong")] or [0.0])
    share = f"{as_is} ({100.0 * as_is / max(models, 1):.0f} %)"
    ends = f"{kinds['right']} | {kinds['wrong']} | {kinds['refused']} | {notes:.1f}"
    return f"| {name} | {total} | {kinds['no model']} | {share} | {helped} | {ends} |"


def detail(name: str, found: dict[str, Verdict]) -> list[str]:
    """Return counts of refused and wrong models of a set, by reason."""
    reasons = Counter(
        f"{v.kind}: {QUOTED.sub('...', v.words)[:110]}"
        for v in found.values()
        if v.kind in ("refused", "wrong")
    )
    if not reasons:
        return []
    return [f"## {name}", "", *(f"- {count} {reason}" for reason, count in reasons.most_common(12)), ""]


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
