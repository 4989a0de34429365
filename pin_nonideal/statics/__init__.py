"""Scenes at rest, and the torques of a given motion."""
