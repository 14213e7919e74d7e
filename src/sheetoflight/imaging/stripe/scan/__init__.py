"""The laser line in streams of frames: one centre for every column or row, at the camera's rate."""
