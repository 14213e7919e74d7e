"""Streams of pictures, one frame at a time, whatever holds them.

::

    paths -> list_frames -> Frame, Frame, …   where each picture is: light, and sent to processes
                              |
                        read_frames            its file is opened, that frame alone is read

Kinds of files: pictures and folders of them, TIFF of several pages, NumPy's ``.npy``, HDF5, video.
Neither their number nor their length costs memory: a frame is read when its turn comes.
"""

from sheetoflight.io.frames.frame import DamagedFrame, Frame, Pictures
from sheetoflight.io.frames.listing import FrameList, list_frames
from sheetoflight.io.frames.reading import read_frame, read_frames

__all__ = [
    "DamagedFrame",
    "Frame",
    "FrameList",
    "Pictures",
    "list_frames",
    "read_frame",
    "read_frames",
]
