"""Engines that know no word of cameras or lasers."""
