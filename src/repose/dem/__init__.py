"""The discrete element engine: shapes, contacts, walls and time.

It does not depend on the calibration.

The names below are imported when they are first used, so that importing a small module
of this package does not load the compiler.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .io.recorder import Recorder as Recorder
    from .io.vtk import VtkSeries as VtkSeries
    from .io.vtk import write_vtk as write_vtk
    from .materials import Contact as Contact
    from .materials import Material as Material
    from .rotations import random_quaternion as random_quaternion
    from .rotations import rotation_matrices as rotation_matrices
    from .rotations import rotation_matrix as rotation_matrix
    from .shapes import Clump as Clump
    from .shapes import Shape as Shape
    from .simulation import Simulation as Simulation
    from .walls import Cone as Cone
    from .walls import Cylinder as Cylinder
    from .walls import Mesh as Mesh
    from .walls import Motion as Motion
    from .walls import Plane as Plane
    from .walls import RingEdge as RingEdge

_NAMES = {
    "io.recorder": ["Recorder"],
    "io.vtk": ["VtkSeries", "write_vtk"],
    "materials": ["Contact", "Material"],
    "rotations": ["random_quaternion", "rotation_matrices", "rotation_matrix"],
    "shapes": ["Clump", "Shape"],
    "simulation": ["Simulation"],
    "walls": ["Cone", "Cylinder", "Mesh", "Motion", "Plane", "RingEdge"],
}
_MODULE_OF = {name: module for module, names in _NAMES.items() for name in names}

__all__ = sorted(_MODULE_OF)


def __getattr__(name: str) -> object:
    if name not in _MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = import_module(f".{_MODULE_OF[name]}", __name__)
    value = getattr(module, name)
    globals()[name] = value  # the next use finds it without this function
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
