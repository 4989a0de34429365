"""URDF files: parsing, checks, meshes and inertias."""
