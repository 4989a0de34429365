"""Command line of the benchmarks: which parts run, on what, beside whom, and where the results go."""

from __future__ import annotations

import argparse
import json
import platform
import sys
import time
from collections.abc import Callable, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent
DEFAULT_OUTPUT = ROOT.parent / "build" / "benchmarks" / "results"
RECORDED = ROOT / "results"
PACKAGES = ("pin", "numpy", "scipy", "mujoco", "exudyn")


def main(arguments: Sequence[str]) -> int:
    """Runs the parts asked for, or one of the actions.

    Args:
        arguments: words of the command line.

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
    made.add_argument("--only", metavar="PROBLEM", help="one problem or case")
    made.add_argument(
        "--peers", metavar="NAMES", help="peers to run, separated by commas; none: just us (default: all)"
    )
    made.add_argument(
        "--output", type=Path, default=DEFAULT_OUTPUT, metavar="FOLDER", help="where results are written"
    )
    return made


EPILOG = """parts:
  evaluation   seconds of one constrained acceleration, against Pinocchio's C++ and MuJoCo
  scaling      the same against the number of loops, N four-bars
  accuracy     run time against error, problem by problem
  features     what a loop, a law, sticking, recording add to an evaluation and a step
  batches      steps a second of many states in one and two threads
actions:
  build-peers  compile the C++ peers (some minutes, once)
  references   compute the references anew
"""


def run_parts(options: argparse.Namespace) -> int:
    """Runs the parts and writes one JSON file for each."""
    options.output.mkdir(parents=True, exist_ok=True)
    for name in options.parts or PARTS:
        print(f"{name}:", flush=True)
        begin = time.perf_counter()
        results = PARTS[name](options)
        record = {"part": name, "quick": options.quick, "machine": machine(), "results": results}
        path = options.output / f"{name}.json"
        path.write_text(json.dumps(record, indent=1) + "\n")
        print(f"  {time.perf_counter() - begin:.0f} s, {path}", flush=True)
    return 0


def machine() -> dict[str, Any]:
    """What a reader has to know about where the numbers come from, in general terms."""
    import os

    versions = {}
    for package in PACKAGES:
        try:
            versions[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    return {
        "machine": f"{os.cpu_count()}-core {platform.machine().replace('_', '-')}",
        "python": platform.python_version(),
        "packages": versions,
    }


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


def features(options: argparse.Namespace) -> Any:
    from . import features

    return features.measure(options.quick, say)


def batches(options: argparse.Namespace) -> Any:
    from . import batches

    return batches.measure(options.quick, options.only, say)


def chosen_tools(options: argparse.Namespace) -> list[Any]:
    """Ours and the peers asked for that are installed; the others are told."""
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


def build_peers(options: argparse.Namespace) -> int:
    from . import build_peers

    del options
    return build_peers.build()


def references(options: argparse.Namespace) -> int:
    from . import problems, reference_store

    del options
    reference_store.write([problems.problem(name) for name in problems.MAKERS])
    return 0


PARTS: dict[str, Callable[[argparse.Namespace], Any]] = {
    part.__name__: part for part in (evaluation, scaling, accuracy, features, batches)
}
ACTIONS: dict[str, Callable[[argparse.Namespace], int]] = {
    "build-peers": build_peers,
    "references": references,
}

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
