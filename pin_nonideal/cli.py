"""The command `pin-nonideal`: run a robot, list the robots, describe one, run the benchmarks.

Exit codes: 0 done; 2 an error of the package, told in one line on standard error; 130 interrupted by Ctrl-C.
What a run had computed when it failed or was interrupted is written to the files asked for all the same.
"""

from __future__ import annotations

import argparse
import os
import runpy
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import pin_nonideal as pn

from .errors import InputError, OutputError, PinNonidealError, RunError, RunInterrupted
from .loading import robots
from .plotting import picture_format
from .scene import SEVERAL
from .trajectory import Trajectory
from .types import Table

EXIT_ERROR = 2
EXIT_UNREAD = 141  # 128 and the number of SIGPIPE, as shells show it
EXIT_INTERRUPTED = 130  # 128 + SIGINT, as shells report it

# Samples per second of simulated time when pictures are asked for: a replay page shows no more.
PICTURE_RATE = 60.0


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Args:
        arguments: the words after the command's name; those of the process when None.

    Returns:
        The exit code.
    """
    options, rest = _parser().parse_known_args(arguments)
    if rest and options.command is not _bench:
        _parser().error(f"unrecognized arguments: {' '.join(rest)}")
    options.rest = rest
    try:
        code = int(options.command(options))
        sys.stdout.flush()
        return code
    except RunInterrupted as error:
        print(f"pin-nonideal: interrupted: {error}", file=sys.stderr)
        return EXIT_INTERRUPTED
    except KeyboardInterrupt:
        print("pin-nonideal: interrupted", file=sys.stderr)
        return EXIT_INTERRUPTED
    except BrokenPipeError:  # the reader of the output, such as `head`, has had enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_UNREAD
    except PinNonidealError as error:
        print(f"pin-nonideal: error: {error}", file=sys.stderr)
        return EXIT_ERROR


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="pin-nonideal",
        description="Robots with loops, contacts and friction, simulated through their explicit equation.",
    )
    parser.add_argument("--version", action="version", version=f"%(prog)s {pn.__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    run = commands.add_parser("run", help="simulate a robot and write what is asked for")
    _add_robot(run)
    run.add_argument(
        "--duration", type=float, default=5.0, metavar="S", help="length of time [s] (default: 5)"
    )
    run.add_argument("--method", help="integrator, e.g. dop853 (default), dopri5, rk4, Radau")
    run.add_argument("--rtol", type=float, help="relative tolerance of adaptive methods")
    run.add_argument("--atol", type=float, help="absolute tolerance of adaptive methods")
    run.add_argument("--dt", type=float, metavar="S", help="step of fixed-step methods [s]")
    run.add_argument(
        "--output-dt",
        type=float,
        metavar="S",
        help=f"time between samples [s] (default: every step; 1/{PICTURE_RATE:.0f} with --html or --plot)",
    )
    run.add_argument(
        "--record",
        metavar="NAMES",
        help="what to record, separated by commas: a, forces, laws, reactions, energy, power "
        "(default: nothing; forces,energy with --html or --plot)",
    )
    run.add_argument(
        "--several",
        choices=SEVERAL,
        help="where friction allows several motions: stop (default), or go on with the nearest",
    )
    run.add_argument(
        "--html", type=Path, metavar="FILE", help="write the replay, one page that needs no network"
    )
    run.add_argument("--plot", type=Path, metavar="FILE", help="write a figure (.png, .pdf, .svg)")
    run.add_argument("--save", type=Path, metavar="FILE", help="write the arrays (.npz)")
    run.set_defaults(command=_run)

    listing = commands.add_parser("list", help="robots of the package, by name")
    listing.set_defaults(command=_list)

    info = commands.add_parser("info", help="joints, loops, rows, rank, mobility and what is skipped")
    _add_robot(info)
    info.set_defaults(command=_info)

    bench = commands.add_parser(
        "bench", help="run the benchmarks of a checkout; further words go to them", add_help=False
    )
    bench.set_defaults(command=_bench)
    return parser


def _add_robot(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "robot", metavar="NAME_OR_PATH", help="name from `list`, robot folder, .urdf or .xml (MJCF)"
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        dest="settings",
        metavar="KEY=VALUE",
        help="parameter of a generated robot, e.g. --set N=40; may be repeated",
    )


def _run(options: argparse.Namespace) -> int:
    writers = _writers(options)
    scene = pn.load(options.robot, **_parameters(options.settings))
    settings = _simulation_settings(options)
    try:
        run = pn.simulate(scene, options.duration, **settings)
    except RunError as error:
        if error.trajectory is not None:
            print(error.trajectory)
            _write(error.trajectory, writers)
        raise
    print(run)
    _write(run, writers)
    return 0


def _simulation_settings(options: argparse.Namespace) -> Table:
    """Keyword arguments of `simulate`: what was given on the command line, and the defaults of pictures."""
    given = {key: getattr(options, key) for key in ("method", "rtol", "atol", "dt", "output_dt", "several")}
    settings = {key: value for key, value in given.items() if value is not None}
    pictures = options.html is not None or options.plot is not None
    if pictures and options.output_dt is None:
        settings["output_dt"] = 1.0 / PICTURE_RATE
    if options.record is not None:
        settings["record"] = tuple(name.strip() for name in options.record.split(",") if name.strip())
    elif pictures:
        settings["record"] = ("forces", "energy")
    return settings


def _writers(options: argparse.Namespace) -> list[tuple[Path, Callable[[Trajectory, Path], Path]]]:
    """Files to write and what writes them; they are checked now, because a run may take long."""
    if options.plot is not None:
        picture_format(options.plot)
    asked: list[tuple[Path | None, Callable[[Trajectory, Path], Path]]] = [
        (options.save, lambda run, path: run.save(path)),
        (options.html, _write_replay),
        (options.plot, _write_figure),
    ]
    writers = [(path, writer) for path, writer in asked if path is not None]
    for path, _ in writers:
        folder = path.parent
        if not folder.is_dir():
            raise OutputError(f'cannot write "{path}": there is no folder "{folder}"; create it first')
        if path.is_dir():
            raise OutputError(f'cannot write "{path}": it is a folder; give the name of a file')
        if not os.access(path if path.exists() else folder, os.W_OK):
            raise OutputError(f'cannot write "{path}": no permission; choose another place')
    return writers


def _write(run: Trajectory, writers: list[tuple[Path, Callable[[Trajectory, Path], Path]]]) -> None:
    for path, writer in writers:
        print(f"wrote {writer(run, path)}")


def _write_replay(run: Trajectory, path: Path) -> Path:
    pn.replay(run, path)
    return path


def _write_figure(run: Trajectory, path: Path) -> Path:
    pn.plot(run, path)
    return path


def _parameters(settings: Sequence[str]) -> Table:
    """KEY=VALUE words as keyword arguments."""
    parameters: Table = {}
    for word in settings:
        key, separator, text = word.partition("=")
        if not separator or not key.isidentifier():
            raise InputError(f'--set needs KEY=VALUE, for example --set N=40; got "{word}"')
        parameters[key] = _value(text)
    return parameters


def _value(text: str) -> int | float | bool | str:
    """A whole number, a number, true or false; anything else is text."""
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return {"true": True, "false": False}.get(text, text)


def _list(options: argparse.Namespace) -> int:
    del options
    listed = robots()
    width = max((len(name) for name, _ in listed), default=0)
    for name, description in listed:
        print(f"{name:{width}}  {description}".rstrip())
    return 0


def _info(options: argparse.Namespace) -> int:
    print(pn.load(options.robot, **_parameters(options.settings)).report())
    return 0


def _bench(options: argparse.Namespace) -> int:
    """Run the folder `benchmarks` of the checkout: benchmarks are no part of the installed package."""
    places = [Path.cwd(), Path(__file__).resolve().parent.parent]
    for place in places:
        folder = place / "benchmarks"
        if (folder / "__main__.py").is_file():
            sys.argv[1:] = options.rest
            runpy.run_path(str(folder), run_name="__main__")
            return 0
    raise InputError(
        "bench needs the folder benchmarks of a checkout; run it there: git clone, cd, pin-nonideal bench"
    )
