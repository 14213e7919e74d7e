"""Rigs, scenes and pictures whose truth is known."""
