"""Pictures in, observations out: markers and the laser line.

The only place that looks into pictures with OpenCV.
"""
