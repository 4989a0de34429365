"""Trajectories: samples, events, records, files, and states between samples."""
