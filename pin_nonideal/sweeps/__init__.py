"""Runs over a grid of parameters, stored as they end."""
