"""URDF files: parsing, checks, meshes, inertias."""
