"""Check that the installed pin_nonideal came from a portable wheel.

Usage: python .ci/check_wheel.py, in an environment with an installed wheel.  Exit code 0: the wheel contains
one library, the core.  The core finds Pinocchio's libraries by a path relative to itself, contains no path of
the build machine, and rejects another minor version of Pinocchio.
"""

from __future__ import annotations

import re
import subprocess
import sys
from importlib import metadata
from pathlib import Path

HOME = "cmeel.prefix/lib"  # library folder of the pin wheel in site-packages
# Libraries that the core may link: libraries of the pin wheel and of the system.
NEEDED = r"(lib(pinocchio|boost)_|lib(stdc\+\+|m|gcc_s|c|pthread)\.so|ld-linux|lib(c\+\+|System))"
# Folders in which a wheel is built.
BUILT = rb"/(?:tmp|home|root|work|project|build|Users|private|opt/_internal|var/folders)/[^\0\n]{3,120}"
REFUSED = "import pinocchio; pinocchio.__version__ = '4.999.0'; import pin_nonideal"


def core() -> Path:
    """Return the path of the core in the installed wheel."""
    files = metadata.files("pin-nonideal") or []
    libraries = [file for file in files if file.suffix in (".so", ".dylib", ".pyd")]
    assert [file.stem.split(".")[0] for file in libraries] == ["_core"], libraries
    return Path(libraries[0].locate())


def output(*command: str) -> str:
    """Return the standard output of a command."""
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def searched_and_needed(library: Path) -> tuple[list[str], list[str]]:
    """Return the run-time search path of a library, and the libraries that it needs."""
    if sys.platform == "darwin":
        folders = re.findall(r"cmd LC_RPATH\n.*\n\s*path (\S+)", output("otool", "-l", str(library)))
        lines = output("otool", "-L", str(library)).splitlines()[1:]
        return folders, [line.split()[0] for line in lines]
    table = output("readelf", "-d", str(library))
    (folders,) = re.findall(r"\(R(?:UN)?PATH\).*\[(.*)\]", table)
    return folders.split(":"), re.findall(r"\(NEEDED\).*\[(.*)\]", table)


def main() -> None:
    """Run all checks."""
    library = core()
    folders, needed = searched_and_needed(library)
    origin = "@loader_path" if sys.platform == "darwin" else "$ORIGIN"
    assert folders == [f"{origin}/../{HOME}"], folders
    strange = [name for name in needed if not re.match(NEEDED, Path(name).name)]
    assert needed, "the core needs no library"
    assert not strange, strange
    system = ("/usr/lib/", "/System/")
    placed = [name for name in needed if name.startswith("/") and not name.startswith(system)]
    assert not placed, placed
    told = re.findall(BUILT, library.read_bytes())
    assert not told, told
    done = subprocess.run([sys.executable, "-c", REFUSED], capture_output=True, text=True, check=False)
    assert done.returncode != 0, "another minor version of Pinocchio was let in"
    assert "was built for Pinocchio" in done.stderr, done.stderr
    print(f"{library.name}: looks in {folders[0]}, needs {', '.join(sorted(needed))}")


if __name__ == "__main__":
    main()
