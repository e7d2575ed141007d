"""Read VTK files, as simulators write them for ParaView: points with values.

The package pyvista, which the extra `vtk` installs, reads them. LIGGGHTS writes them by
``dump custom/vtk``, Yade by ``VTKRecorder`` and ``export.VTKExporter``.
"""

import re
from pathlib import Path

import numpy as np
import pandas as pd

from repose.common.errors import InputError

LEGACY_START = b"# vtk DataFile"  # begins a file in the old format, which is not XML
# The root element of an XML file; its attribute `type` is the type of the data.
XML_ROOT = re.compile(rb"<VTKFile\s[^>]*?\btype=\"(\w+)\"")
# Types of data that may contain particles, with the file extension that pyvista expects
EXTENSION_BY_TYPE = {"UnstructuredGrid": ".vtu", "PolyData": ".vtp"}
START_BYTES = 4096  # number of bytes from which the format of a file is recognised
INSTALL_COMMAND = "pip install 'repose-dem[vtk]'"


def is_vtk(start: bytes) -> bool:
    """Tell whether a file that begins with these bytes is a VTK file."""
    return start.startswith(LEGACY_START) or XML_ROOT.search(start) is not None


def read_table(path: Path) -> pd.DataFrame:
    """Read the points of a VTK file as a table.

    Parameters
    ----------
    path : Path
        The file, for whose first bytes `is_vtk` returns True.

    Returns
    -------
    pandas.DataFrame
        A row for each point. The columns are `x`, `y`, `z`, and each value of the
        points that is a single number. Vectors are left out.

    Raises
    ------
    InputError
        If pyvista is not installed, or cannot read the file.
    """
    extension = _find_extension(path)
    try:
        import pyvista
    except ModuleNotFoundError as error:
        raise InputError(
            path,
            key="file",
            value="VTK",
            allowed=(
                f"pyvista, which reads it: {INSTALL_COMMAND}; or a LAMMPS or LIGGGHTS "
                "dump, a CSV file or a Yade text file"
            ),
        ) from error
    # Tell pyvista the format, because LIGGGHTS also writes XML into files named .vtk.
    try:
        grid = pyvista.get_reader(path, force_ext=extension).read()
        columns = dict(zip("xyz", np.asarray(grid.points, dtype=float).T, strict=True))
        for name, values in grid.point_data.items():
            if values.ndim == 1:
                columns[name] = np.asarray(values)
    # A damaged file causes any of these errors. For example, the result of a reader
    # lacks the attribute `points` if the file has none.
    except (AttributeError, RuntimeError, TypeError, ValueError) as error:
        first_line = str(error).partition("\n")[0]
        raise InputError(
            path, key="file", value=first_line, allowed="a VTK file with points"
        ) from error
    return pd.DataFrame(columns)


def _find_extension(path: Path) -> str:
    """Find the file extension that pyvista expects for the format of a VTK file.

    The format is recognised by the content of the file, because the extension in its
    name may be wrong. `is_vtk` must be True for the file. Raises InputError for a type
    of data that cannot contain particles.
    """
    with path.open("rb") as file:
        start = file.read(START_BYTES)
    if start.startswith(LEGACY_START):
        return ".vtk"
    xml_root = XML_ROOT.search(start)
    assert xml_root is not None  # true for all other files that `is_vtk` accepts
    data_type = xml_root[1].decode()
    if data_type not in EXTENSION_BY_TYPE:
        raise InputError(
            path,
            key="VTKFile type",
            value=data_type,
            allowed=f"one of {', '.join(EXTENSION_BY_TYPE)}",
        )
    return EXTENSION_BY_TYPE[data_type]
