"""Scene: a model with all its descriptions, compiled."""
