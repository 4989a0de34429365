"""Runs of a scene: options, integration, checkpoints, batches."""
