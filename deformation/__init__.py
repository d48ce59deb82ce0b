"""Skin over a pose: meshes, the lattice, weights, volume and flesh that moves."""
