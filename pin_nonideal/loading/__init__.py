"""Robots from files (URDF, MJCF, robot.yaml) and generated robots."""
