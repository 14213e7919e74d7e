"""The steps a user names – detect, calibrate, measure, report, simulate – as plain functions.

They read and write files and return frozen results; they print nothing. `Progress` tells a
caller who wants to know how far a long step has come.
"""
