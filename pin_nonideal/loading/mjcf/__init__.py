"""MJCF files: MuJoCo compiles them, and the compiled model becomes the arguments of a scene."""
