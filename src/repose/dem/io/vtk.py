"""Bodies and walls as VTK files that ParaView opens.

The format is XML PolyData with each array in base64, so every bit of a number survives. The writer is this one page;
the libraries that could do it bring a renderer or a mesh converter along.
"""

import base64
import math
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

import numpy as np

from ..checks import chosen
from ..rotations import rotation_matrices
from ..tessellation import joined, triangulated_bodies, triangulated_walls
from .whole import write_whole

if TYPE_CHECKING:
    from ..simulation import Simulation

VTK_TYPES = {"f8": "Float64", "i8": "Int64", "i4": "Int32", "u1": "UInt8"}

# Points, cells ("Verts" or "Polys", and the points of each (M, corners)), point data, cell data.
Content = tuple[
    np.ndarray, tuple[str, np.ndarray], dict[str, np.ndarray], dict[str, np.ndarray]
]


def write_vtk(
    path: str | os.PathLike, simulation: "Simulation", content: str = "points"
) -> None:
    """Write one .vtp file of a simulation as it is now.

    Parameters
    ----------
    path : path
        The file, which ends in .vtp.
    simulation : Simulation
        The simulation.
    content : {"points", "surfaces", "walls"}
        What is written. "points": a point for each body that is there; "surfaces": the bodies as triangles, with id
        and shape; "walls": all walls as triangles, with the number of the wall.

    Raises
    ------
    ValueError
        For another content or ending.

    Notes
    -----
    All is in SI units. A point has id, shape (its place among the names of the shapes), scale, quaternion (w, x, y, z),
    velocity, angular_velocity, semi_axes (half the extents along the body's axes), and tensor. The eigenvalues of the
    tensor are the full extents: ParaView's Tensor Glyph with a sphere of radius 0.5 draws each ellipsoid in its size
    and place. The names of shapes and walls are in the field data.
    """
    path = _ending(path, ".vtp")
    made = chosen("content", content, _CONTENT_OF)(simulation)
    names = (
        {"wall_names": simulation.wall_set.surfaces}
        if content == "walls"
        else {"shape_names": simulation.shapes}
    )
    text = _poly_data(simulation.time_s, names, made)
    write_whole(path, lambda handle: handle.write(text.encode()))


def _ending(path: str | os.PathLike, suffix: str) -> Path:
    """Check how a path ends."""
    if Path(path).suffix != suffix:
        raise ValueError(
            f"path is {str(path)!r}; expected a file that ends in {suffix}"
        )
    return Path(path)


def _body_points(simulation: "Simulation") -> Content:
    """Return points, cells, point data and cell data of the bodies as points."""
    here = np.flatnonzero(simulation.present)
    extents = np.array([shape.half_extents_m for shape in simulation.shapes.values()])
    semi_axes = simulation.scales[here, None] * extents[simulation.shape_ids[here]]
    turn = rotation_matrices(simulation.quaternions[here])
    data = {
        "id": here,
        "shape": simulation.shape_ids[here],
        "scale": simulation.scales[here],
        "quaternion": simulation.quaternions[here],
        "velocity": simulation.velocities[here],
        "angular_velocity": simulation.angular_velocities[here],
        "semi_axes": semi_axes,
        "tensor": np.einsum("nij,nj,nkj->nik", turn, 2.0 * semi_axes, turn).reshape(
            -1, 9
        ),
    }
    return (
        simulation.positions[here],
        ("Verts", np.arange(len(here))[:, None]),
        data,
        {},
    )


def _body_surfaces(simulation: "Simulation") -> Content:
    """Return points, cells, point data and cell data of the bodies as triangles."""
    points, triangles, body = triangulated_bodies(simulation)
    return (
        points,
        ("Polys", triangles),
        {},
        {"id": body, "shape": simulation.shape_ids[body]},
    )


def _walls(simulation: "Simulation") -> Content:
    """Return points, cells, point data and cell data of the walls."""
    # `triangulated_walls` has the order of `surfaces`
    surfaces = triangulated_walls(simulation).values()
    points, triangles, wall = joined(surfaces, np.arange(len(surfaces)))
    return points, ("Polys", triangles), {}, {"wall": wall}


_CONTENT_OF = {"points": _body_points, "surfaces": _body_surfaces, "walls": _walls}


def _data_array(name: str, values: np.ndarray, extra: str = "") -> str:
    """Write a DataArray element: the number of bytes and the bytes, in base64."""
    values = np.ascontiguousarray(values)
    code = values.dtype.str[1:]
    columns = values.shape[1] if values.ndim > 1 else 1
    coded = np.uint64(values.nbytes).tobytes() + values.astype("<" + code).tobytes()
    return (
        f"<DataArray type={quoteattr(VTK_TYPES[code])} Name={quoteattr(name)} "
        f'NumberOfComponents="{columns}"{extra} format="binary">{base64.b64encode(coded).decode()}</DataArray>'
    )


def _names_array(name: str, names: Sequence[str]) -> str:
    """Write an array of texts: the codes of their letters, each text ended by a 0."""
    codes = " ".join(
        " ".join(str(byte) for byte in [*text.encode(), 0]) for text in names
    )
    return f'<Array type="String" Name={quoteattr(name)} NumberOfTuples="{len(names)}" format="ascii">{codes}</Array>'


def _poly_data(
    time_s: float, names: Mapping[str, Iterable[str]], content: Content
) -> str:
    """Write the text of a .vtp file."""
    points, (kind, corners), point_data, cell_data = content
    ends = corners.shape[1] * np.arange(1, len(corners) + 1)
    links = (
        ("connectivity", corners.reshape(-1).astype(np.int64)),
        ("offsets", ends.astype(np.int64)),
    )
    piece = _element(
        f'Piece NumberOfPoints="{len(points)}" NumberOf{kind}="{len(corners)}"',
        *_element("Points", _data_array("position", points)),
        *_element(kind, *(_data_array(*link) for link in links)),
        *_element("PointData", *(_data_array(*entry) for entry in point_data.items())),
        *_element("CellData", *(_data_array(*entry) for entry in cell_data.items())),
    )
    time = _data_array("TimeValue", np.array([time_s]), ' NumberOfTuples="1"')
    fields = _element(
        "FieldData",
        time,
        *(_names_array(name, list(texts)) for name, texts in names.items()),
    )
    file = 'VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64"'
    return _text(_element(file, *_element("PolyData", *fields, *piece)))


def _element(tag: str, *content: str) -> list[str]:
    """Write the lines of an element; the tag comes with its attributes."""
    return [f"<{tag}>", *content, f"</{tag.partition(' ')[0]}>"]


def _text(lines: list[str]) -> str:
    """Write the text of a file."""
    return "\n".join(['<?xml version="1.0"?>', *lines]) + "\n"


class VtkSeries:
    """A series of .vtp files and the .pvd file that gives each its time; ParaView opens the .pvd.

    Call it with a simulation to add its present state, or give it to `Simulation.run(record=...)`. Walls that never
    moved are written once.

    Parameters
    ----------
    path : path
        The .pvd file; the others lie beside it, in a folder of its name.
    surfaces : bool
        Whether bodies are written as triangles instead of points.

    Raises
    ------
    ValueError
        For another ending than .pvd.
    """

    def __init__(self, path: str | os.PathLike, surfaces: bool = False) -> None:
        self.path = _ending(path, ".pvd")
        self.content = "surfaces" if surfaces else "points"
        self._entries: list[tuple[float, list[str]]] = []
        self._walls: str | None = None
        self._places = np.zeros(0)

    def __call__(self, simulation: "Simulation") -> None:
        """Write the present state and bring the .pvd up to date.

        Parameters
        ----------
        simulation : Simulation
            The simulation.

        Raises
        ------
        ValueError
            Where its time is not later than that of the last state.
        """
        number, time = len(self._entries), simulation.time_s
        if not math.isfinite(time) or (self._entries and time <= self._entries[-1][0]):
            raise ValueError(
                f"time_s is {time!r}; expected later than the last one, {self._entries[-1][0]!r}"
            )
        bodies = f"{self.path.stem}/bodies_{number:06d}.vtp"
        write_vtk(self.path.parent / bodies, simulation, self.content)
        files = [bodies]
        if simulation.wall_set.surfaces:
            places = np.concatenate(
                [simulation.walls.planes.ravel(), simulation.walls.frames.ravel()]
            )
            if self._walls is None or not np.array_equal(places, self._places):
                self._walls, self._places = (
                    f"{self.path.stem}/walls_{number:06d}.vtp",
                    places,
                )
                write_vtk(self.path.parent / self._walls, simulation, "walls")
            files.append(self._walls)
        self._entries.append((time, files))
        text = self._collection()
        write_whole(self.path, lambda handle: handle.write(text.encode()))

    def _collection(self) -> str:
        """Write the text of the .pvd file."""
        sets = [
            f'<DataSet timestep="{time!r}" part="{part}" file={quoteattr(file)}/>'
            for time, files in self._entries
            for part, file in enumerate(files)
        ]
        return _text(
            _element(
                'VTKFile type="Collection" version="1.0"',
                *_element("Collection", *sets),
            )
        )
