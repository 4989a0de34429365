"""Benchmarks: run time against error, cost per evaluation, per feature and per loop, beside the alternatives.

`pin-nonideal bench` or `python -m benchmarks` runs them in a checkout; `--help` tells the rest.  Peers are
optional (`pip install '.[bench]'`); the loop over Pinocchio and SciPy is always there.
"""
