"""Scene: a model and its descriptions, compiled into the core's program."""
