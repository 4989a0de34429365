"""Data of a replay page: motion, forces, geometry and signals."""
