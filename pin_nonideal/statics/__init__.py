"""Statics of scenes: equilibria, feasibility of rest, and inverse dynamics."""
