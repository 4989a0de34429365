"""MJCF files: MuJoCo compiles them, and what it compiles becomes the arguments of a scene."""
