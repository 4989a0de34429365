"""Command line of the benchmarks: selection of parts, problems, peers and output folder."""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
import time
from collections.abc import Callable, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent
DEFAULT_OUTPUT = ROOT.parent / "build" / "benchmarks" / "results"
PACKAGES = ("pin", "numpy", "scipy", "mujoco", "exudyn", "drake")
DIGITS = 6  # significant digits of numbers in the results


def main(arguments: Sequence[str]) -> int:
    """Run the requested parts, or one of the actions.

    Args:
        arguments: arguments of the command line.

    Returns:
        The exit code.
    """
    options = parser().parse_args(arguments)
    unknown = [word for word in options.parts if word not in (*PARTS, *ACTIONS)]
    if unknown:
        parser().error(f"no part {unknown[0]!r}; there are {', '.join((*PARTS, *ACTIONS))}")
    for word in options.parts:
        if word in ACTIONS:
            return ACTIONS[word](options)
    return run_parts(options)


def parser() -> argparse.ArgumentParser:
    made = argparse.ArgumentParser(
        prog="pin-nonideal bench", description="Benchmarks of run time and accuracy.", epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    made.add_argument("parts", nargs="*", metavar="PART", help="parts to run (default: all), or one action")
    made.add_argument("--quick", action="store_true", help="short runs, under two minutes in all")
    made.add_argument("--only", metavar="PROBLEM", help="one problem or case; results of others are kept")
    made.add_argument(
        "--peers", metavar="NAMES", help="peers to run, separated by commas; none: just us (default: all)"
    )
    made.add_argument(
        "--output", type=Path, default=DEFAULT_OUTPUT, metavar="FOLDER", help="folder of the results"
    )
    return made


EPILOG = """parts:
  evaluation   seconds of one constrained acceleration, against Pinocchio's C++ and MuJoCo
  scaling      the same against the number of loops, N four-bars
  accuracy     run time against error, problem by problem
  growth       the same and whole runs against links, mechanisms, feet, runs; errors beside long double
  features     what a loop, a law, sticking, recording add to an evaluation and a step
  batches      steps a second of many states in one and two threads
  contacts     bouncing, sliding, standing: time against error, a step, an impact, open contacts
  bodies       stacks, dominoes, walls and piles: time of a step, creep, errors of the laws
  long         ten simulated seconds: cost, closure gap, energy change
  footprint    time and memory of an import
actions:
  build        compile the core in a temporary folder: processor time, wall time and memory by room
  build-peers  compile the C++ peers (some minutes, once)
  references   compute the references anew
  report       keep the full results of the output folder; write the page of benchmarks, figures of the README
"""


def run_parts(options: argparse.Namespace) -> int:
    """Run the parts; write JSON, Markdown and, if available, a picture for each part."""
    from . import plots, report

    options.output.mkdir(parents=True, exist_ok=True)
    for name in options.parts or PARTS:
        print(f"{name}:", flush=True)
        begin = time.perf_counter()
        results = PARTS[name](options)
        record = {"part": name, "quick": options.quick, "machine": machine(), "results": rounded(results)}
        path = options.output / f"{name}.json"
        if options.only is not None:
            record = beside_the_others(record, path)
        path.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
        path.with_suffix(".md").write_text(report.section(record), encoding="utf-8")
        plots.draw({name: record}, options.output / "benchmarks")
        print(f"  {time.perf_counter() - begin:.0f} s, {path}", flush=True)
    return 0


def beside_the_others(record: dict[str, Any], path: Path) -> dict[str, Any]:
    """Return new results merged into earlier results with the same settings on the same machine."""
    if not path.is_file():
        return record
    before = json.loads(path.read_text(encoding="utf-8"))
    if any(before[key] != record[key] for key in ("quick", "machine")):
        return record
    key = "problem" if record["part"] in ("accuracy", "long") else "case"
    renewed = {result[key]: result for result in record["results"]}
    others = [renewed.pop(result[key], result) for result in before["results"]]
    return record | {"results": [*others, *renewed.values()]}


def rounded(value: Any) -> Any:
    """Return results with numbers rounded to DIGITS significant digits."""
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}")
    if isinstance(value, dict):
        return {key: rounded(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [rounded(item) for item in value]
    return value


def machine() -> dict[str, Any]:
    """Return processor, system and package versions of the measurements."""
    versions, absent = {}, []
    for package in PACKAGES:
        try:
            versions[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            absent.append(package)
    return {
        "machine": f"{os.cpu_count()} cores of {processor()}, {platform.system()}",
        "python": platform.python_version(),
        "packages": versions,
        "absent": absent,
    }


def processor() -> str:
    """Return the processor's model if the system provides it, else its architecture."""
    info = Path("/proc/cpuinfo")
    if info.is_file():
        for line in info.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def say(text: str) -> None:
    print(text, flush=True)


def evaluation(options: argparse.Namespace) -> Any:
    from . import evaluation

    return evaluation.measure(options.quick, options.only, say)


def accuracy(options: argparse.Namespace) -> Any:
    from . import accuracy, problems

    tools = chosen_tools(options)
    results = []
    for name in problems.MAKERS if options.only is None else [options.only]:
        if name not in problems.MAKERS:
            continue
        say(f" {name}")
        results.append(accuracy.measure(problems.problem(name), tools, options.quick, say))
    return results


def scaling(options: argparse.Namespace) -> Any:
    from . import scaling

    return scaling.measure(options.quick, say)


def growth(options: argparse.Namespace) -> Any:
    from . import growth

    return growth.measure(options.quick, options.only, say)


def features(options: argparse.Namespace) -> Any:
    from . import features

    return features.measure(options.quick, say)


def batches(options: argparse.Namespace) -> Any:
    from . import batches

    return batches.measure(options.quick, options.only, say)


def long(options: argparse.Namespace) -> Any:
    from . import long

    return long.measure(chosen_tools(options), options.quick, options.only, say)


def contacts(options: argparse.Namespace) -> Any:
    from . import contacts

    rivals = {tool.name for tool in chosen_tools(options)}
    return contacts.measure(rivals, options.quick, options.only, say)


def bodies(options: argparse.Namespace) -> Any:
    from . import many_contacts

    rivals = {tool.name for tool in chosen_tools(options)}
    return many_contacts.measure_all(rivals, options.quick, options.only, say)


def footprint(options: argparse.Namespace) -> Any:
    from . import footprint

    return footprint.measure(options.quick, say)


def chosen_tools(options: argparse.Namespace) -> list[Any]:
    """Return this package and the requested peers that are installed; missing peers are printed."""
    from .tools import TOOLS

    wanted = None if options.peers is None else [word.strip() for word in options.peers.split(",")]
    tools = []
    for name, tool in TOOLS.items():
        if name != "pin_nonideal" and wanted is not None and name not in wanted:
            continue
        reason = tool.missing()
        if reason:
            say(f"  {name} left out: {reason}")
        else:
            tools.append(tool)
    return tools


def build(options: argparse.Namespace) -> int:
    from . import build_core

    del options
    return build_core.build()


def build_peers(options: argparse.Namespace) -> int:
    from . import build_peers

    del options
    return build_peers.build()


def references(options: argparse.Namespace) -> int:
    from . import problems, reference_store

    del options
    reference_store.write([problems.problem(name) for name in problems.MAKERS])
    return 0


def report(options: argparse.Namespace) -> int:
    from . import report

    report.keep_full_runs(options.output)
    report.write()
    return 0


PARTS: dict[str, Callable[[argparse.Namespace], Any]] = {
    part.__name__: part
    for part in (evaluation, scaling, growth, accuracy, features, batches, contacts, bodies, long, footprint)
}
ACTIONS: dict[str, Callable[[argparse.Namespace], int]] = {
    "build": build,
    "build-peers": build_peers,
    "references": references,
    "report": report,
}

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
