"""The one entry of the benchmarks: `python -m benchmarks`, or this folder run by `pin-nonideal bench`."""

from __future__ import annotations

import os
import sys
from pathlib import Path

# One thread for everybody; libraries read this when they are loaded.
for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")

if not __package__:
    import pin_nonideal as _installed  # found before the checkout is put in front of it

    del _installed
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.command import main  # noqa: E402

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
