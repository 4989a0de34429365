"""What a replay page carries: motion, forces, geometry, signals."""
