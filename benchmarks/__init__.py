"""Benchmarks: run time against error, and cost per evaluation, feature and loop, compared with other tools.

`pin-nonideal bench` or `python -m benchmarks` runs the benchmarks in a checkout; `--help` lists the options.
Peers are optional (`pip install '.[bench]'`).  The loop over Pinocchio and SciPy is always available.
"""
