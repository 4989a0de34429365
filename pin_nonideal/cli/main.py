"""Command line `pin-nonideal`: run robots and examples, resume, replay, sweep, describe, find equilibria.

Exit codes: 0 for success, 2 for an error of the package with one line on standard error, 130 for Ctrl-C.
A run that fails or is interrupted writes its samples to the requested files.
"""

from __future__ import annotations

import argparse
import os
import runpy
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pin_nonideal as pn
from pin_nonideal.errors import InputError, PinNonidealError, RunInterrupted
from pin_nonideal.loading.library.example_robots import example_robots
from pin_nonideal.loading.robot_files import robots
from pin_nonideal.scene.evaluation import SEVERAL_CHOICES
from pin_nonideal.trajectory.trajectory import Trajectory
from pin_nonideal.types import Table
from pin_nonideal.visualization.rendering import render

from .commands import (
    completion,
    describe_robot,
    named_values,
    print_equilibrium,
    replay_file,
    sweep_file,
)
from .examples import examples, run_example
from .run import parameters, resume_run, run_robot

EXIT_ERROR = 2
EXIT_BROKEN_PIPE = 141  # 128 + SIGPIPE, as shells report it
EXIT_INTERRUPTED = 130  # 128 + SIGINT, as shells report it


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Args:
        arguments: words after the name of the command; None selects the words of the process.

    Returns:
        Exit code.
    """
    options, rest = _parser().parse_known_args(arguments)
    if rest and options.command is not _bench:
        _parser().error(f"unrecognized arguments: {' '.join(rest)}")
    options.rest = rest
    try:
        code = int(options.command(options))
        if sys.stdout is not None:  # the shell may have closed the output
            sys.stdout.flush()
        return code
    except RunInterrupted as error:
        print(f"pin-nonideal: interrupted: {error}", file=sys.stderr)
        return EXIT_INTERRUPTED
    except KeyboardInterrupt:
        print("pin-nonideal: interrupted", file=sys.stderr)
        return EXIT_INTERRUPTED
    except BrokenPipeError:  # the reader of the output, such as `head`, has closed the pipe
        _discard_output()
        return EXIT_BROKEN_PIPE
    except PinNonidealError as error:
        print(f"pin-nonideal: error: {error}", file=sys.stderr)
        return EXIT_ERROR
    except OSError as error:  # a full disk, or a closed terminal
        print(f"pin-nonideal: error: cannot print: {error.strerror or error}", file=sys.stderr)
        _discard_output()
        return EXIT_ERROR


def _discard_output() -> None:
    """Redirect standard output to the null device, so that the interpreter does not flush it at exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="pin-nonideal",
        description="Simulate robots with closed loops, contacts and dry friction.",
    )
    parser.add_argument("--version", action="version", version=f"%(prog)s {pn.__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    run = commands.add_parser("run", help="simulate a robot and write files")
    _add_robot(run)
    run.add_argument(
        "--duration", type=float, default=5.0, metavar="S", help="duration of the run [s] (default: 5)"
    )
    run.add_argument("--method", help="integration method: dop853 (default), dopri5, rk4, Radau, ...")
    run.add_argument("--rtol", type=float, help="relative tolerance of adaptive methods")
    run.add_argument("--atol", type=float, help="absolute tolerance of adaptive methods")
    run.add_argument("--dt", type=float, metavar="S", help="step of fixed-step methods [s]")
    run.add_argument(
        "--output-dt",
        type=float,
        metavar="S",
        help="time between samples [s] (default: every step; with --html or --plot at least 1200 samples)",
    )
    run.add_argument(
        "--record",
        metavar="NAMES",
        help="recorded quantities, separated by commas: a, forces, laws, reactions, energy, power "
        "(default: nothing; forces,energy with --html or --plot)",
    )
    run.add_argument(
        "--several",
        choices=SEVERAL_CHOICES,
        help="if friction admits several motions: stop with an error (default), or continue with the nearest",
    )
    run.add_argument(
        "--checkpoint", type=Path, metavar="FILE", help="file that stores the state of the run, for `resume`"
    )
    _add_start(run)
    run.add_argument("--v", **_start("velocity"))
    _add_writers(run)
    run.set_defaults(command=run_robot)

    resume = commands.add_parser("resume", help="continue a run from its checkpoint")
    resume.add_argument("file", type=Path, metavar="CHECKPOINT", help="file of `run --checkpoint`")
    _add_writers(resume)
    resume.set_defaults(command=resume_run)

    replay = commands.add_parser("replay", help="write the replay page of a saved run")
    replay.add_argument(
        "run", type=Path, metavar="RUN.npz", help="file of `run --save`, or folder of `sweep`"
    )
    replay.add_argument(
        "page", type=Path, nargs="?", metavar="PAGE.html", help="page to write (default: beside the run)"
    )
    replay.add_argument("--run", type=int, dest="number", metavar="K", help="index of the run in a sweep")
    replay.add_argument("--robot", metavar="NAME_OR_PATH", help="robot of a run whose file does not name it")
    replay.set_defaults(command=replay_file)

    sweep = commands.add_parser(
        "sweep", help="run a robot with many sets of parameters and store the runs in a folder"
    )
    sweep.add_argument(
        "file",
        type=Path,
        metavar="SWEEP.yaml",
        help="file with the robot, the duration, and a grid or samples",
    )
    sweep.add_argument(
        "--jobs", type=int, metavar="N", help="number of parallel processes; -1 for all processors"
    )
    sweep.set_defaults(command=sweep_file)

    equilibrium = commands.add_parser("equilibrium", help="compute an equilibrium of a robot")
    _add_robot(equilibrium)
    _add_start(equilibrium)
    equilibrium.add_argument("--json", action="store_true", help="print JSON")
    equilibrium.set_defaults(command=_equilibrium)

    example = commands.add_parser("example", help="run an example and write its figure")
    example.add_argument("name", metavar="NAME", help="name of an example from `list`")
    example.set_defaults(command=_example)

    listing = commands.add_parser("list", help="print the names of robots and examples")
    listing.add_argument("--all", action="store_true", help="also print the robots of example-robot-data")
    listing.set_defaults(command=_list)

    info = commands.add_parser("info", help="print joints, constraints, rows, rank and mobility of a robot")
    _add_robot(info)
    info.add_argument("--json", action="store_true", help="print all tables as JSON")
    info.set_defaults(command=_info)

    picture = commands.add_parser(
        "render", help="render a picture or a video of a run (.png, .gif, .webm, .mp4)"
    )
    picture.add_argument("run", metavar="RUN", help="file of `run --save` (.npz)")
    picture.add_argument("out", type=Path, metavar="OUT", help="file to write")
    picture.add_argument(
        "--robot", metavar="NAME_OR_PATH", help="robot of the run (default: the name in the file)"
    )
    picture.add_argument(
        "--width", type=int, default=960, help="width of the picture [pixels] (default: 960)"
    )
    picture.add_argument(
        "--height", type=int, default=540, help="height of the picture [pixels] (default: 540)"
    )
    picture.add_argument("--seconds", type=float, default=6.0, help="duration of the video [s] (default: 6)")
    picture.add_argument(
        "--fps", type=float, default=25.0, help="frames per second of the video (default: 25)"
    )
    picture.add_argument("--time", type=float, metavar="S", help="time of a still picture [s]")
    _add_setting(picture)
    picture.set_defaults(command=_render)

    complete = commands.add_parser("completion", help="print a completion script for a shell")
    complete.add_argument("shell", choices=("bash", "zsh", "fish"))
    complete.set_defaults(command=_complete)

    bench = commands.add_parser(
        "bench", help="run the benchmarks of a checkout; see `bench --help`", add_help=False
    )
    bench.set_defaults(command=_bench)
    return parser


def _add_robot(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "robot", metavar="NAME_OR_PATH", help="name from `list`, robot folder, .urdf or .xml (MJCF)"
    )
    _add_setting(parser)


def _add_setting(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        dest="settings",
        metavar="KEY=VALUE",
        help="parameter of a generated robot, e.g. --set N=40; may be repeated",
    )


def _start(what: str) -> Table:
    """Return the settings of an option that gives a state by joint name."""
    return {
        "action": "append",
        "default": [],
        "metavar": "JOINT=NUMBER",
        "help": f"initial {what} of a joint, e.g. elbow=0.5 or base.xyz=0,0,1; may be repeated",
    }


def _add_start(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--q", **_start("configuration"))


def _add_writers(parser: argparse.ArgumentParser) -> None:
    page = "write the replay as one HTML file"
    parser.add_argument("--html", type=Path, metavar="FILE", help=page)
    parser.add_argument("--plot", type=Path, metavar="FILE", help="write a figure (.png, .pdf, .svg)")
    parser.add_argument("--save", type=Path, metavar="FILE", help="write the arrays (.npz)")
    parser.add_argument("--events", action="store_true", help="print the events, one per line")
    parser.add_argument("--quiet", action="store_true", help="print only requested output")


def _equilibrium(options: argparse.Namespace) -> int:
    scene = pn.load(options.robot, **parameters(options.settings))
    return print_equilibrium(scene, named_values(options.q, "--q"), options.json)


def _complete(options: argparse.Namespace) -> int:
    names = [[name for name, _ in each] for each in (robots(), examples())]
    print(completion(_parser(), options.shell, *names))
    return 0


def _example(options: argparse.Namespace) -> int:
    print(f"wrote {run_example(options.name)}")
    return 0


def _list(options: argparse.Namespace) -> int:
    groups = {"robots: pin-nonideal run NAME": robots(), "examples: pin-nonideal example NAME": examples()}
    if options.all:
        groups["robots of example-robot-data: pin-nonideal run NAME"] = example_robots()
    width = max((len(name) for listed in groups.values() for name, _ in listed), default=0)
    for title, listed in groups.items():
        print(title)
        for name, description in listed:
            print(f"  {name:{width}}  {description}".rstrip())
    return 0


def _info(options: argparse.Namespace) -> int:
    return describe_robot(pn.load(options.robot, **parameters(options.settings)), options.json)


def _render(options: argparse.Namespace) -> int:
    run = Trajectory.load(options.run)
    if run.scene is None:
        scene = pn.load(options.robot or run.name, **parameters(options.settings))
        run = replace(run, scene=scene)
    keys = ("width", "height", "seconds", "fps", "time")
    print(f"wrote {render(run, options.out, **{key: getattr(options, key) for key in keys})}")
    return 0


def _bench(options: argparse.Namespace) -> int:
    """Run the folder `benchmarks` of the checkout; the installed package does not contain benchmarks."""
    places = [Path.cwd(), Path(__file__).resolve().parent.parent.parent]
    for place in places:
        folder = place / "benchmarks"
        if (folder / "__main__.py").is_file():
            sys.argv[1:] = options.rest
            runpy.run_path(str(folder), run_name="__main__")
            return 0
    raise InputError(
        "bench needs the folder benchmarks of a checkout; run it there: git clone, cd, pin-nonideal bench"
    )
