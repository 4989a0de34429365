"""Example robots and generated mechanisms."""
