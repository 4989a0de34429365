"""Descriptions of a scene: constraints, contacts, laws, forces, actuation and functions of time."""
