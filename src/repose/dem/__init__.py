"""The discrete element engine: shapes, contacts, walls and time; it does not depend on the calibration.

A name below is imported at its first use, so that the import of a small module of this package does not load the
compiler.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .io.recorder import Recorder
    from .io.vtk import VtkSeries, write_vtk
    from .materials import Contact, Material
    from .rotations import random_quaternion, rotation_matrices, rotation_matrix
    from .shapes import Clump, Shape
    from .simulation import Simulation
    from .walls import Cone, Cylinder, Mesh, Motion, Plane, RingEdge

_HOME = {
    "Clump": "shapes",
    "Cone": "walls",
    "Contact": "materials",
    "Cylinder": "walls",
    "Material": "materials",
    "Mesh": "walls",
    "Motion": "walls",
    "Plane": "walls",
    "Recorder": "io.recorder",
    "RingEdge": "walls",
    "Shape": "shapes",
    "Simulation": "simulation",
    "VtkSeries": "io.vtk",
    "random_quaternion": "rotations",
    "rotation_matrices": "rotations",
    "rotation_matrix": "rotations",
    "write_vtk": "io.vtk",
}

__all__ = [
    "Clump",
    "Cone",
    "Contact",
    "Cylinder",
    "Material",
    "Mesh",
    "Motion",
    "Plane",
    "Recorder",
    "RingEdge",
    "Shape",
    "Simulation",
    "VtkSeries",
    "random_quaternion",
    "rotation_matrices",
    "rotation_matrix",
    "write_vtk",
]


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f".{_HOME[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
