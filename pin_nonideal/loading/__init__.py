"""Robots as files describe them: URDF, MJCF, robot.yaml, and generated ones."""
