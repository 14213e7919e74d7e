"""Planes, lines, rays and rotations in plain NumPy."""
