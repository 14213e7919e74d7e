"""Point clouds as files: one module a family of formats, one table of their endings.

::

    cloud -> columns (names, units, order) -> csv, xyz | npy | ply | las, laz | e57
"""

from sheetoflight.io.clouds.formats import (
    CLOUD_ENDINGS,
    check_cloud_name,
    read_cloud,
    write_cloud,
)

__all__ = ["CLOUD_ENDINGS", "check_cloud_name", "read_cloud", "write_cloud"]
