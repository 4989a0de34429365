"""States of a scene: configurations, their placements, and the way onto the constraints."""
