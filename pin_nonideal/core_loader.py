"""Loader of the compiled core, with a check of its Pinocchio version.

The core is linked to the libraries of one minor version of the `pin` wheel. With another version, the memory
layout of models and data may differ, so the import raises ImportError.
"""

from __future__ import annotations

import importlib
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

import pinocchio

__all__ = ["core", "load_core"]

_AGAIN = "pip install '{}' brings the Pinocchio that it needs"


def load_core() -> ModuleType:
    """Load the compiled module `pin_nonideal._core` and check it against the installed Pinocchio.

    Returns:
        The module.

    Raises:
        ImportError: the core is missing, does not load, or was built for another minor version of `pin`.
    """
    # Pinocchio is imported first, since it registers the conversion of Python models that the core needs.
    installed = str(pinocchio.__version__)
    try:
        core = importlib.import_module("pin_nonideal._core")
    except ModuleNotFoundError:
        raise ImportError(_missing_core_message()) from None
    except ImportError as error:
        raise ImportError(
            f"the compiled core of pin_nonideal does not load beside Pinocchio {installed} ({error}); "
            f"{_reinstall_message()}"
        ) from error
    # A source folder named _core imports as an empty namespace package when nothing is compiled.
    if getattr(core, "__file__", None) is None:
        raise ImportError(_missing_core_message())
    built = str(core.pinocchio_version)
    if built.split(".")[:2] != installed.split(".")[:2]:
        raise ImportError(
            f"the compiled core of pin_nonideal was built for Pinocchio {built}, and "
            f"Pinocchio {installed} is installed; {_reinstall_message()}"
        )
    return core


def _reinstall_message() -> str:
    from importlib import metadata

    try:
        needed = [each for each in metadata.requires("pin-nonideal") or [] if each.startswith("pin=")]
    except metadata.PackageNotFoundError:  # imported from a path, not installed
        needed = []
    return _AGAIN.format(*needed, "pin")


def _missing_core_message() -> str:
    folder = Path(__file__).parent
    return (
        f"the compiled core of pin_nonideal is missing in {folder}: this is the source folder, "
        'imported because Python runs in its parent; run "pip install -e ." there, or start Python in '
        "another folder"
    )


if TYPE_CHECKING:
    from . import _core as core
else:
    core = load_core()
