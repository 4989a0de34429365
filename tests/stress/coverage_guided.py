"""Fuzzing that follows the coverage of the package's Python code, by Atheris (`pip install atheris`).

    python tests/stress/coverage_guided.py robot.yaml -max_total_time=600

The first argument is the kind of input: robot.yaml, robot.urdf, trajectory or checkpoint.  The other
arguments are those of libFuzzer.
Inputs grow from the files of the package's robots; one that ends in an error without a name is written to
crash-<digest> in the current folder and shown with its traceback.
"""

from __future__ import annotations

import contextlib
import os
import sys
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["pin_nonideal", "yaml"]):
    import pin_nonideal as pn
    from pin_nonideal.loading.robot_files import robot_folders

SMALL = ("four_bar", "slider_crank", "five_bar", "belt_oscillator", "loaded_joint")


def folder_with(name: str, place: Path) -> Callable[[bytes], object]:
    """Loads the four-bar's folder with one of its files exchanged."""
    for file in ("robot.yaml", "robot.urdf"):
        (place / file).write_bytes((robot_folders()["four_bar"] / file).read_bytes())

    def read(data: bytes) -> object:
        (place / name).write_bytes(data)
        return pn.load(place)

    return read


def file_for(load: Callable[[Path], object], place: Path) -> Callable[[bytes], object]:
    """Reads a file of these bytes."""

    def read(data: bytes) -> object:
        (place / "file").write_bytes(data)
        return load(place / "file")

    return read


def seeds(what: str, place: Path) -> list[bytes]:
    """Good inputs to start from."""
    if what.startswith("robot."):
        return [(robot_folders()[name] / what).read_bytes() for name in SMALL]
    checkpoint = place / "checkpoint"
    run = pn.simulate(pn.load("four_bar"), 0.01, record=("energy", "forces"), checkpoint=checkpoint)
    return [checkpoint.read_bytes()] if what == "checkpoint" else [run.save(place / "run.npz").read_bytes()]


def main() -> None:
    what, *rest = sys.argv[1:]
    place, corpus = Path(tempfile.mkdtemp()), Path(tempfile.mkdtemp())
    targets = {
        "robot.yaml": folder_with("robot.yaml", place),
        "robot.urdf": folder_with("robot.urdf", place),
        "trajectory": file_for(pn.Trajectory.load, place),
        "checkpoint": file_for(pn.resume, place),
    }
    read = targets[what]
    for k, data in enumerate(seeds(what, place)):
        (corpus / str(k)).write_bytes(data)
    warnings.simplefilter("ignore")
    os.dup2(
        os.open(os.devnull, os.O_WRONLY), 1
    )  # Pinocchio's parsers talk; libFuzzer reports on standard error

    def one(data: bytes) -> None:
        with contextlib.suppress(pn.PinNonidealError):
            read(data)

    atheris.Setup([sys.argv[0], *rest, str(corpus)], one)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
