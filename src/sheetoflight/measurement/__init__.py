"""A calibration and pixels in, millimetres with their uncertainty out."""
