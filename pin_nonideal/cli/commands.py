"""Commands beside `run` and `resume`: replay, sweep, equilibrium, info and completion."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pin_nonideal.atomic_files import check_writable, file_path
from pin_nonideal.errors import InputError, LoadingError, short_repr
from pin_nonideal.loading.load import load
from pin_nonideal.loading.yaml.plain_values import plain_yaml
from pin_nonideal.loading.yaml.robot import check_keys
from pin_nonideal.scene.scene import Scene, compiled_scene
from pin_nonideal.statics.equilibrium import equilibrium
from pin_nonideal.sweeps.grid import sweep_grid, sweep_samples
from pin_nonideal.sweeps.store import Sweep
from pin_nonideal.sweeps.sweep import sweep
from pin_nonideal.trajectory.trajectory import Trajectory
from pin_nonideal.types import Table
from pin_nonideal.visualization.replay import replay

SWEEP_KEYS = ("robot", "parameters", "duration", "grid", "samples", "options", "store", "jobs", "failures")


def plain_value(text: str) -> object:
    """Return a word as an integer, a number or a truth value, else as text.

    Args:
        text: word of the command line.
    """
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return {"true": True, "false": False}.get(text, text)


def named_values(words: Sequence[str], option: str) -> Table | None:
    """Return JOINT=NUMBER[,NUMBER...] and JOINT.PIECE=... as a table by joint name, or None without words.

    Args:
        words: words of the command line.
        option: name of the option, for messages.

    Raises:
        InputError: a word has another form.
    """
    table: Table = {}
    for word in words:
        name, separator, text = word.partition("=")
        try:
            numbers = [float(x) for x in text.split(",")]
        except ValueError:
            numbers = []
        if not separator or not name or not numbers:
            raise InputError(
                f"{option} needs JOINT=NUMBER, JOINT=NUMBER,NUMBER,... or JOINT.PIECE=NUMBER,..., such as "
                f'{option} elbow=0.5 or {option} base.xyz=0,0,1; got "{word}"'
            )
        value: object = numbers[0] if len(numbers) == 1 else numbers
        joint, dot, piece = name.rpartition(".")
        if dot and piece in ("xyz", "rpy", "quaternion", "xy", "angle", "linear", "angular"):
            table.setdefault(joint, {})[piece] = value
        else:
            table[name] = value
    return table or None


def replay_file(options: argparse.Namespace) -> int:
    """Write the replay of a saved run.

    Args:
        options: run and page, paths; number of the run if the path is the folder of a sweep; robot, name or
            path of the run's robot, or None.

    Raises:
        InputError: a number is given without a folder, a folder without a number, or the robot is unknown.
    """
    if options.page is not None:
        check_writable(file_path("PAGE.html", options.page), "the replay")
    scene = "source" if options.robot is None else load(options.robot)
    path, number = Path(options.run), options.number
    if path.is_dir() != (number is not None):
        kind = "a" if path.is_dir() else "no"
        raise InputError(f'--run K selects a run in the folder of a sweep; "{path}" is {kind} folder')
    if number is None:
        run, page = Trajectory.load(path, scene=scene), path.with_suffix(".html")
    else:
        stored_runs = Sweep(path)
        if not 0 <= number < len(stored_runs):
            raise InputError(f"--run must be at least 0 and below {len(stored_runs)}; got {number}")
        run, page = stored_runs.load(number, scene), path.with_name(f"{path.resolve().name}.{number}.html")
    if run.scene is None:
        because = f": {run.notes[-1]}" if run.notes else ""
        raise InputError(
            f'"{path}" names no robot that `load` finds{because}; give one: --robot NAME_OR_PATH'
        )
    page = options.page or page
    replay(run, page)
    print(f"wrote {page}")
    return 0


def describe_robot(scene: Scene, as_json: bool) -> int:
    """Print the parts of a robot: joints, constraints, laws, rows and mobility.

    Args:
        scene: scene of the robot.
        as_json: whether to print JSON, for programs.
    """
    if not as_json:
        print(scene.report())
        return 0
    q, v = scene.initial_state()
    data = scene.describe().to_dict()
    data |= {"source": scene.source, "licence": scene.licence, "notes": scene.notes}
    data |= {"nq": scene.model.nq, "nv": scene.model.nv, "q0": q.tolist(), "v0": v.tolist()}
    data["dropped"] = [list(each) for each in scene.dropped]
    print(json.dumps(data, indent=2))
    return 0


def print_equilibrium(scene: Scene, q: Any, as_json: bool) -> int:
    """Print a state of rest.

    Args:
        scene: scene of the robot.
        q: start configuration by joint name, or None.
        as_json: whether to print JSON, for programs.
    """
    rest = equilibrium(scene, q)
    places = compiled_scene(scene).joints
    values = {p.name: rest.q[p.q_first : p.q_first + p.nq].tolist() for p in places}
    if as_json:
        data = {"q": values, "stable": rest.stable, "left": rest.left, "rates": rest.rates.real.tolist()}
        print(json.dumps(data, indent=2))
        return 0
    print({True: "stable", False: "unstable", None: "neutral"}[rest.stable])
    width = max(len(name) for name in values)
    for place in places:
        x = rest.q[place.q_first : place.q_first + place.nq]
        turns = place.kind.startswith(("JointModelRUB", "JointModelRevoluteUnbounded"))
        shown = [np.arctan2(x[1], x[0])] if turns else x
        print(f"  {place.name:{width}}  " + " ".join(f"{number:.9g}" for number in shown))
    return 0


def sweep_file(options: argparse.Namespace) -> int:
    """Run the sweep of a YAML file.

    Args:
        options: file, a path; jobs, a number or None.
    """
    path = Path(options.file)
    table = _sweep_table(path)
    points = _points(table, path)
    fixed, robot = table.get("parameters") or {}, str(table["robot"])
    beside = path.parent / robot
    make = _Robot(str(beside.resolve()) if beside.exists() else robot, fixed)
    store = path.parent / str(table.get("store", path.stem + ".runs"))
    jobs = options.jobs if options.jobs is not None else table.get("jobs")
    settings: Table = {
        key: tuple(x) if isinstance(x, list) else x for key, x in (table.get("options") or {}).items()
    }
    keep = str(table.get("failures", "keep"))
    runs: Any = sweep(make, points, table["duration"], jobs=jobs, store=store, failures=keep, **settings)
    print(runs)
    for name, data in runs.summary().items():
        q = data["quantiles"]
        print(
            f"  {name}: mean {data['mean']:.6g}, median {q[0.5]:.6g}, 90 % in {q[0.05]:.6g} to {q[0.95]:.6g}"
        )
    for k, error in list(runs.failures.items())[:10]:
        print(f"  run {k} {runs.records[k]['parameters']}: {error}")
    return 0


class _Robot:
    """Loader of a robot with the parameters of one run; defined in a module, so that it can be serialized."""

    def __init__(self, robot: str, fixed: Mapping[str, Any]) -> None:
        self.robot, self.fixed = robot, dict(fixed)

    def __call__(self, **parameters: object) -> Scene:
        """Return the scene of the robot."""
        return load(self.robot, **{**self.fixed, **parameters})


def _sweep_table(path: Path) -> Table:
    table = plain_yaml(path)
    if not isinstance(table, dict):
        raise LoadingError(f'"{path}" must be a table with the keys {", ".join(SWEEP_KEYS)}')
    check_keys(table, SWEEP_KEYS, f'"{path}"')
    for key in ("robot", "duration"):
        if key not in table:
            raise LoadingError(f'"{path}" needs the key "{key}"')
    for key in ("parameters", "grid", "samples", "options"):
        if not isinstance(table.get(key) or {}, dict):
            raise LoadingError(f'"{path}": {key} must be a table; got {short_repr(table[key])}')
    return table


def _points(table: Table, path: Path) -> list[Table]:
    """Return parameters of the runs: a grid, or samples {n: .., kind: .., ranges: {name: [low, high]}}."""
    if bool(table.get("grid")) == bool(table.get("samples")):
        raise LoadingError(f'"{path}" must have one of the keys grid and samples')
    if table.get("grid"):
        return sweep_grid(**table["grid"])
    samples = dict(table["samples"])
    check_keys(samples, ("n", "kind", "seed", "ranges"), f'"{path}": samples')
    ranges = samples.pop("ranges", None) or {}
    return sweep_samples(samples.pop("n", 0), **samples, **ranges)


def completion(
    parser: argparse.ArgumentParser, shell: str, robots: Sequence[str], examples: Sequence[str]
) -> str:
    """Return a script that completes commands, options and names of robots and examples in a shell.

    Args:
        parser: parser of the command line.
        shell: "bash", "zsh" or "fish".
        robots: names of the robots.
        examples: names of the examples, arguments of the command `example`.
    """
    actions = [a for a in parser._actions if isinstance(a, argparse._SubParsersAction)]
    commands = {name: _options(sub) for name, sub in actions[0].choices.items()}
    if shell == "fish":
        lines = ["complete -c pin-nonideal -f -n __fish_use_subcommand -a '" + " ".join(commands) + "'"]
        for name, own in commands.items():
            condition = f"__fish_seen_subcommand_from {name}"
            names = examples if name == "example" else robots
            lines.append(f"complete -c pin-nonideal -n '{condition}' -a '{' '.join(names)}'")
            lines += [f"complete -c pin-nonideal -n '{condition}' -l {option[2:]}" for option in own]
        return "\n".join(lines)
    cases = "\n".join(f'    {name}) words="{" ".join(own)}" ;;' for name, own in commands.items())
    body = f"""_pin_nonideal() {{
  local word="${{COMP_WORDS[COMP_CWORD]}}" words="{" ".join(commands)}"
  if [ "$COMP_CWORD" -gt 1 ]; then
    case "${{COMP_WORDS[1]}}" in
{cases}
    esac
    local names="{" ".join(robots)}"
    if [ "${{COMP_WORDS[1]}}" = example ]; then names="{" ".join(examples)}"; fi
    case "$word" in -*) ;; *) words="$names" ;; esac
  fi
  COMPREPLY=( $(compgen -W "$words" -- "$word") $(compgen -f -- "$word") )
}}
complete -o filenames -F _pin_nonideal pin-nonideal"""
    return f"autoload -U +X bashcompinit && bashcompinit\n{body}" if shell == "zsh" else body


def _options(parser: argparse.ArgumentParser) -> list[str]:
    return [option for a in parser._actions for option in a.option_strings if option.startswith("--")]


def format_events(run: Trajectory) -> str:
    """Return the events of a run, one line each.

    Args:
        run: trajectory of the run.
    """
    return "\n".join(f"{e.time:.9g} s  {e.kind}  {e.element}" for e in run.events) or "no events"
