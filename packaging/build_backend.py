"""Build backend: scikit-build-core with three additions for source installs.

- A Python older than 3.10 raises an error with advice, before pip searches for wheels that do not exist.
- A line on the terminal announces a full compile; pip shows no output of a successful build.
- Object files are reused. pip makes each isolated environment in a new temporary folder, and
  scikit-build-core discards a build folder that was configured from another environment. No object file of
  this package depends on the environment (pin_nonideal/_core/CMakeLists.txt), so the build folder is kept.
"""

import json
import os
import sys
from pathlib import Path

OLDEST = (3, 10)

if sys.version_info < OLDEST:
    raise SystemExit(
        "pin_nonideal needs Python {0} or newer, and this is Python {1}: {2}\n"
        "Make an environment with a newer one and run the same command again:\n"
        "  python{0} -m venv env && . env/bin/activate\n"
        "  Debian, Ubuntu:  sudo apt install python3-venv\n"
        "  any system:      conda create -n env python=3.12, or https://docs.astral.sh/uv".format(
            ".".join(map(str, OLDEST)), sys.version.split()[0], sys.executable
        )
    )

import scikit_build_core.build as backend  # noqa: E402

ROOT = Path(__file__).resolve().parent.parent
CORE = ROOT / "pin_nonideal" / "_core"
PROCESSOR_SECONDS = 200.0  # processor time of a whole build, measured by `pin-nonideal bench build`

get_requires_for_build_sdist = backend.get_requires_for_build_sdist
get_requires_for_build_wheel = backend.get_requires_for_build_wheel
get_requires_for_build_editable = backend.get_requires_for_build_editable
prepare_metadata_for_build_wheel = backend.prepare_metadata_for_build_wheel
prepare_metadata_for_build_editable = backend.prepare_metadata_for_build_editable
build_sdist = backend.build_sdist


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    """Build a wheel; see PEP 517."""
    _prepare()
    return backend.build_wheel(wheel_directory, config_settings, metadata_directory)


def build_editable(wheel_directory, config_settings=None, metadata_directory=None):
    """Build a wheel for an editable install; see PEP 660."""
    _prepare()
    return backend.build_editable(wheel_directory, config_settings, metadata_directory)


def _prepare():
    infos = list((ROOT / "build").glob("*/.skbuild-info.json"))
    for info in infos:
        _keep_objects(info)
    if not infos:
        _announce()


def _keep_objects(info):
    """Set this environment as the one that configured a build folder."""
    try:
        content = json.loads(info.read_text(encoding="utf-8"))
        content["skbuild_path"] = os.fspath(Path(backend.__file__).parent.parent.resolve())
        info.write_text(json.dumps(content, indent=2), encoding="utf-8")
    except (OSError, ValueError, TypeError):
        pass  # scikit-build-core then discards the folder


def _announce():
    """Print number of sources and expected compile time, also to the terminal if there is one."""
    sources = len(list(CORE.rglob("*.cpp")))
    processors = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    minutes = max(1, round(PROCESSOR_SECONDS / processors / 60.0 + 0.5))
    line = (
        f"pin_nonideal: compiling the core, {sources} C++ sources, once; about {minutes} min on {processors} "
        f"processor{'s' * (processors > 1)} (pip -v shows each)"
    )
    print(line, flush=True)
    try:
        with open("/dev/tty", "w", encoding="utf-8") as terminal:
            terminal.write(f"\n  {line}\n")
    except OSError:
        pass
