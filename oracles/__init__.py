"""Reference implementations for tests and benchmarks, each independent of the core.

`dense` and `dense_friction` implement the mechanics separately. `eq40_by_paper` implements the equations of
the paper as printed, and `paper_a_particle`, `paper_b_ring` and `paper_c_incline` have the formulas of its
examples. The folder is not installed: tests/conftest.py and benchmarks/__main__.py add it to the path.
"""
