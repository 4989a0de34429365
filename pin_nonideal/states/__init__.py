"""States of a scene: configurations, placements, and projection onto the constraints."""
