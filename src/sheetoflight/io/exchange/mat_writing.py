"""Variables as a MATLAB file of version 5."""

from __future__ import annotations

import io
from typing import Any

_HEADER = b"MATLAB 5.0 MAT-file, written by sheetoflight".ljust(116)
"""In place of SciPy's, which states the time of writing."""


def mat_bytes(variables: dict[str, Any]) -> bytes:
    """Variables as SciPy writes them; the same variables give the same bytes."""
    from scipy.io import savemat

    buffer = io.BytesIO()
    savemat(buffer, variables, format="5", oned_as="column")
    return _HEADER + buffer.getvalue()[len(_HEADER) :]
