"""Shared output and command line of the examples."""

from __future__ import annotations

import argparse
from pathlib import Path

import pin_nonideal as pn


def show(what, computed, expected):
    print(f"  {what:46s} {computed:18.12f} {expected:18.12f} {abs(computed - expected):9.1e}")


def run_examples(text, examples, arguments=None):
    """Run the named examples, or all; each example is a function that returns its run."""
    parser = argparse.ArgumentParser(description=text.splitlines()[0])
    parser.add_argument("names", nargs="*", help=f"any of {', '.join(examples)}; all when left out")
    parser.add_argument("--html", metavar="FOLDER", type=Path, help="folder for the replays")
    options = parser.parse_args(arguments)
    unknown = sorted(set(options.names) - set(examples))
    if unknown:
        parser.error(f"no example {', '.join(unknown)}; known: {', '.join(examples)}")
    for name in options.names or examples:
        print(f"{name:48s} {'computed':>18s} {'expected':>18s}")
        run = examples[name]()
        if options.html is not None:
            options.html.mkdir(parents=True, exist_ok=True)
            print(f"  wrote {pn.replay(run, options.html / f'{name}.html')}")
