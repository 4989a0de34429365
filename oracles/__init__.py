"""Oracles: what tests and benchmarks compare the package with, each independent of the core.

`dense` and `dense_friction` are mechanics of their own, `paper_road` is the paper letter by letter.
The folder is no part of the installed package: tests/conftest.py and benchmarks/__main__.py find it.
"""
