"""Compilation of descriptions into the core's program: resolved names, checked user functions."""
