"""Pages and figures for people: the calibration report, and the target to print."""
