"""What a run consists of beside the core's loop: options, SciPy's methods, checkpoints."""
