"""Read files of VTK, as simulators write them for ParaView: points with values.

pyvista reads them, which comes with the extra `vtk`. LIGGGHTS writes them by ``dump
custom/vtk``, Yade by ``VTKRecorder`` and ``export.VTKExporter``.
"""

import re
from pathlib import Path

import numpy as np
import pandas as pd

from repose.common.errors import InputError

LEGACY_START = b"# vtk DataFile"
# The root of a file in XML; its type is the kind of data.
XML_ROOT = re.compile(rb"<VTKFile\s[^>]*?\btype=\"(\w+)\"")
# Kinds of data that hold particles, with the ending by which pyvista knows them.
ENDING_OF_KIND = {"UnstructuredGrid": ".vtu", "PolyData": ".vtp"}
START_BYTES = 4096
INSTALL_COMMAND = "pip install 'repose-dem[vtk]'"


def is_vtk(start: bytes) -> bool:
    """Tell whether a file that begins with these bytes is a VTK file."""
    return start.startswith(LEGACY_START) or XML_ROOT.search(start) is not None


def read_table(path: Path) -> pd.DataFrame:
    """Read the points of a file as a table.

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
    ending = _find_ending(path)
    try:
        import pyvista
    except ModuleNotFoundError as error:
        raise InputError(
            path,
            key="file",
            value="VTK",
            allowed=(
                f"pyvista, which reads it: {INSTALL_COMMAND}; or a dump, CSV or Yade's text"
            ),
        ) from error
    # Tell pyvista the format, because LIGGGHTS also writes XML into files named .vtk.
    try:
        grid = pyvista.get_reader(path, force_ext=ending).read()
        columns = dict(zip("xyz", np.asarray(grid.points, dtype=float).T, strict=True))
        for name, values in grid.point_data.items():
            if values.ndim == 1:
                columns[name] = np.asarray(values)
    except (AttributeError, RuntimeError, TypeError, ValueError) as error:
        fault = str(error).partition("\n")[0]
        raise InputError(
            path, key="file", value=fault, allowed="a file of VTK with points"
        ) from error
    return pd.DataFrame(columns)


def _find_ending(path: Path) -> str:
    """Find the ending that pyvista expects for the format of a file.

    The content of the file tells the format, because its name may have another ending.
    Raises InputError for a kind of data that cannot contain particles.
    """
    with path.open("rb") as file:
        start = file.read(START_BYTES)
    if start.startswith(LEGACY_START):
        return ".vtk"
    kind = XML_ROOT.search(start)
    assert kind is not None
    name = kind[1].decode()
    if name not in ENDING_OF_KIND:
        raise InputError(
            path,
            key="VTKFile type",
            value=name,
            allowed=f"one of {', '.join(ENDING_OF_KIND)}",
        )
    return ENDING_OF_KIND[name]
