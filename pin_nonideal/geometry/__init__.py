"""Shapes of a collision model, and the contacts of pairs of shapes."""
