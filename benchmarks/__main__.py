"""Entry point of the benchmarks: `python -m benchmarks`, or `pin-nonideal bench`, which runs this folder."""

from __future__ import annotations

import os
import sys
from pathlib import Path

# One thread for all tools. Libraries read these variables when they are loaded.
for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")

if not __package__:
    import pin_nonideal as _installed  # imported before the checkout is first on the path

    del _installed
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from benchmarks.command import main  # noqa: E402

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
