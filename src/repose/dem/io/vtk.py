"""Write bodies and walls as VTK files, which ParaView opens.

The format is XML PolyData with each array in base64, so that numbers are written
exactly. No library is used, because those that write this format contain a whole
renderer or mesh converter.
"""

import base64
import math
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple
from xml.sax.saxutils import quoteattr

import numpy as np

from ..checks import look_up_choice
from ..rotations import rotation_matrices
from ..tessellation import join_surfaces, triangulate_bodies, triangulate_walls
from .whole import write_whole

if TYPE_CHECKING:
    from ..observables import Observables

VTK_TYPES = {"f8": "Float64", "i8": "Int64", "i4": "Int32", "u1": "UInt8"}


class PolyData(NamedTuple):
    """The content of a .vtp file."""

    points: np.ndarray  # (N, 3) [m]
    cell_kind: str  # "Verts" or "Polys"
    cells: np.ndarray  # (M, corners), the points of each cell
    point_data: dict[str, np.ndarray]  # by name, a row for each point
    cell_data: dict[str, np.ndarray]  # by name, a row for each cell


def write_vtk(
    path: str | os.PathLike, simulation: "Observables", content: str = "points"
) -> None:
    """Write the present state of a simulation to a .vtp file.

    Parameters
    ----------
    path : path
        The file, whose name ends in .vtp.
    simulation : Simulation
        The simulation.
    content : {"points", "surfaces", "walls"}
        What to write. "points" writes a point for each body that is present, "surfaces"
        the bodies as triangles, with id and shape, and "walls" all walls as triangles,
        with the number of the wall.

    Raises
    ------
    ValueError
        If the content is unknown, or if the file's name does not end in .vtp.

    Notes
    -----
    All values are in SI units. The data of a point are id, shape (the index among the
    names of the shapes), scale, quaternion (w, x, y, z), velocity, angular_velocity,
    semi_axes (half of the extents along the body's axes), and tensor. The eigenvalues
    of the tensor are the full extents, so that ParaView's Tensor Glyph with a sphere of
    radius 0.5 draws each ellipsoid with its true size and orientation. The names of
    shapes and walls are in the field data.
    """
    path = _check_suffix(path, ".vtp")
    collect_data = look_up_choice("content", content, _COLLECTORS)
    # The numbers of shapes or walls in the data are indices of these names.
    if content == "walls":
        names = _format_names("wall_names", simulation.wall_set.surfaces)
    else:
        names = _format_names("shape_names", simulation.shapes)
    text = _format_vtp(simulation.time_s, names, collect_data(simulation))
    # The file is written completely or not at all.
    write_whole(path, lambda handle: handle.write(text.encode()))


def _check_suffix(path: str | os.PathLike, suffix: str) -> Path:
    """Return a path, or raise ValueError if it does not end with the suffix."""
    if Path(path).suffix != suffix:
        raise ValueError(
            f"path is {str(path)!r}; expected a file that ends in {suffix}"
        )
    return Path(path)


def _collect_points(simulation: "Observables") -> PolyData:
    """Collect the bodies that are present as points."""
    bodies = np.flatnonzero(simulation.present)
    shape_ids = simulation.shape_ids[bodies]
    scales = simulation.scales[bodies]
    quaternions = simulation.quaternions[bodies]
    # Half of the extents of each body along its axes, at scale 1
    shape_extents = np.array(
        [shape.half_extents_m for shape in simulation.shapes.values()]
    )
    semi_axes = scales[:, None] * shape_extents[shape_ids]
    # The tensor R diag(full extents) R', with the rotation R of each body. ParaView
    # draws glyphs with the eigenvalues of the tensor as full lengths.
    rotations = rotation_matrices(quaternions)
    tensors = np.einsum("nij,nj,nkj->nik", rotations, 2.0 * semi_axes, rotations)
    return PolyData(
        points=simulation.positions[bodies],
        cell_kind="Verts",
        cells=np.arange(len(bodies))[:, None],
        point_data={
            "id": bodies,
            "shape": shape_ids,
            "scale": scales,
            "quaternion": quaternions,
            "velocity": simulation.velocities[bodies],
            "angular_velocity": simulation.angular_velocities[bodies],
            "semi_axes": semi_axes,
            "tensor": tensors.reshape(-1, 9),
        },
        cell_data={},
    )


def _collect_surfaces(simulation: "Observables") -> PolyData:
    """Collect the bodies as triangles."""
    points, triangles, body = triangulate_bodies(simulation)
    return PolyData(
        points=points,
        cell_kind="Polys",
        cells=triangles,
        point_data={},
        cell_data={"id": body, "shape": simulation.shape_ids[body]},
    )


def _collect_walls(simulation: "Observables") -> PolyData:
    """Collect the walls as triangles.

    A wall's number is its index among the names of the walls.
    """
    surfaces = triangulate_walls(simulation).values()
    points, triangles, wall = join_surfaces(surfaces, np.arange(len(surfaces)))
    return PolyData(
        points=points,
        cell_kind="Polys",
        cells=triangles,
        point_data={},
        cell_data={"wall": wall},
    )


_COLLECTORS = {
    "points": _collect_points,
    "surfaces": _collect_surfaces,
    "walls": _collect_walls,
}


def _format_array(name: str, values: np.ndarray, attributes: str = "") -> str:
    """Return a DataArray element with an array of numbers.

    The content of the element is the number of bytes, followed by the bytes, in base64.

    Parameters
    ----------
    name : str
        Name of the array.
    values : ndarray (N,) or (N, columns)
        The numbers, of a type in `VTK_TYPES`.
    attributes : str
        Further attributes of the element, each with a space before it.

    Returns
    -------
    str
        The element.
    """
    values = np.ascontiguousarray(values)
    type_code = values.dtype.str[1:]  # such as f8, without the order of the bytes
    n_columns = values.shape[1] if values.ndim > 1 else 1
    n_bytes = np.uint64(values.nbytes).tobytes()
    little_endian = values.astype("<" + type_code).tobytes()
    text = base64.b64encode(n_bytes + little_endian).decode()
    return (
        f"<DataArray type={quoteattr(VTK_TYPES[type_code])} Name={quoteattr(name)} "
        f'NumberOfComponents="{n_columns}"{attributes} format="binary">{text}'
        "</DataArray>"
    )


def _format_arrays(arrays: Mapping[str, np.ndarray]) -> list[str]:
    """Return a DataArray element for each array."""
    return [_format_array(name, values) for name, values in arrays.items()]


def _format_names(name: str, names: Iterable[str]) -> str:
    """Return an Array element with names.

    It contains the UTF-8 bytes of each name, followed by a 0.
    """
    texts = list(names)
    codes = [str(byte) for text in texts for byte in [*text.encode(), 0]]
    return (
        f'<Array type="String" Name={quoteattr(name)} NumberOfTuples="{len(texts)}" '
        f'format="ascii">{" ".join(codes)}</Array>'
    )


def _format_vtp(time_s: float, names: str, data: PolyData) -> str:
    """Return the content of a .vtp file.

    Parameters
    ----------
    time_s : float
        Simulated time [s].
    names : str
        XML element with the names of shapes or walls (`_format_names`).
    data : PolyData
        Points, cells, and their data.

    Returns
    -------
    str
        The content in XML.
    """
    # `_format_element` returns a list of lines, and takes the lines inside the element
    # as arguments. The format requires one list with the points of all cells, and for
    # each cell the index in this list at which it ends.
    n_cells, n_corners = data.cells.shape
    ends = n_corners * np.arange(1, n_cells + 1)
    topology = {
        "connectivity": data.cells.reshape(-1).astype(np.int64),
        "offsets": ends.astype(np.int64),
    }
    # The kind of the cells, such as "Verts", is the name of their element and part of
    # an attribute.
    piece = _format_element(
        f'Piece NumberOfPoints="{len(data.points)}" '
        f'NumberOf{data.cell_kind}="{n_cells}"',
        *_format_element("Points", _format_array("position", data.points)),
        *_format_element(data.cell_kind, *_format_arrays(topology)),
        *_format_element("PointData", *_format_arrays(data.point_data)),
        *_format_element("CellData", *_format_arrays(data.cell_data)),
    )
    # Time and names belong to the file as a whole.
    time = _format_array("TimeValue", np.array([time_s]), ' NumberOfTuples="1"')
    fields = _format_element("FieldData", time, names)
    file = _format_element(
        'VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" '
        'header_type="UInt64"',
        *_format_element("PolyData", *fields, *piece),
    )
    return _format_xml(file)


def _format_element(tag: str, *content: str) -> list[str]:
    """Return the lines of an element. The tag includes the attributes."""
    return [f"<{tag}>", *content, f"</{tag.partition(' ')[0]}>"]


def _format_xml(lines: list[str]) -> str:
    """Return the content of an XML file."""
    return "\n".join(['<?xml version="1.0"?>', *lines]) + "\n"


class SavedState(NamedTuple):
    """The files of a simulation at one time."""

    time_s: float
    files: list[str]


class VtkSeries:
    """A series of .vtp files, with a .pvd file that gives the time of each.

    ParaView opens the .pvd file.

    Call the series with a simulation to add its present state, or pass it to
    `Simulation.run` as the argument `record`. Walls that have not moved are not written
    again.

    Parameters
    ----------
    path : path
        The .pvd file. The other files lie beside it in a folder of the same name.
    surfaces : bool
        Whether to write bodies as triangles instead of points.

    Raises
    ------
    ValueError
        If the name of the file does not end in .pvd.
    """

    def __init__(self, path: str | os.PathLike, surfaces: bool = False) -> None:
        self.path = _check_suffix(path, ".pvd")
        self.content = "surfaces" if surfaces else "points"
        self._states: list[SavedState] = []
        # The last file of the walls, and the positions of the walls in it
        self._walls_file: str | None = None
        self._wall_positions = np.zeros(0)

    def __call__(self, simulation: "Observables") -> None:
        """Write the present state to new files, and list them in the .pvd file.

        Parameters
        ----------
        simulation : Simulation
            The simulation.

        Raises
        ------
        ValueError
            If the simulated time is not later than that of the previous state.
        """
        # The states must be in chronological order, and the time finite.
        time = simulation.time_s
        last_time = self._states[-1].time_s if self._states else -math.inf
        if not (math.isfinite(time) and time > last_time):
            raise ValueError(
                f"time_s is {time!r}; expected a time after the last one, {last_time!r}"
            )
        # Write the new files before the .pvd file that lists them, so that it never
        # lists a missing file.
        number = len(self._states)
        bodies_file = f"{self.path.stem}/bodies_{number:06d}.vtp"
        write_vtk(self.path.parent / bodies_file, simulation, self.content)
        files = [bodies_file]
        if simulation.wall_set.surfaces:
            files.append(self._write_walls(simulation, number))
        # Now the files exist. If the .pvd file cannot be written, the next call lists
        # them.
        self._states.append(SavedState(time, files))
        text = self._format_pvd()
        write_whole(self.path, lambda handle: handle.write(text.encode()))

    def _write_walls(self, simulation: "Observables", number: int) -> str:
        """Write the walls, unless they have not moved since they were last written.

        Parameters
        ----------
        simulation : Simulation
            The simulation.
        number : int
            Number of the state, for the name of a new file.

        Returns
        -------
        str
            Name of the file that contains the walls, either a new or an earlier one.
        """
        walls = simulation.walls
        positions = np.concatenate([walls.planes.ravel(), walls.frames.ravel()])
        is_unmoved = np.array_equal(positions, self._wall_positions)
        if self._walls_file is not None and is_unmoved:
            return self._walls_file
        self._walls_file = f"{self.path.stem}/walls_{number:06d}.vtp"
        self._wall_positions = positions
        write_vtk(self.path.parent / self._walls_file, simulation, "walls")
        return self._walls_file

    def _format_pvd(self) -> str:
        """Return the content of the .pvd file."""
        data_sets = []
        for state in self._states:
            for part, file in enumerate(state.files):
                data_sets.append(
                    f'<DataSet timestep="{state.time_s!r}" part="{part}" '
                    f"file={quoteattr(file)}/>"
                )
        collection = _format_element("Collection", *data_sets)
        return _format_xml(
            _format_element('VTKFile type="Collection" version="1.0"', *collection)
        )
