"""A force law: its data, and the kernel that computes its forces.

The engine calls `contact_forces` and `rolling_resistance` with the options of a law.
The options of each law are a named tuple of a type of its own. From this type, numba
chooses the kernel that takes the place of the call, so a compiled loop contains the
code of one law only.

A kernel computes 32 contacts at a time, each in one lane of two tiles (`kernels.rows`
explains tiles):

    scratch   what is computed in this step: copies of the two bodies A and B, the
              geometry, and the forces (rows of `kernels.tile`). The constants of the
              contact law lie from row `tile.LAW` on, those of the rolling law from
              `tile.ROLLING` on.
    history   what the contacts keep from step to step: the normal (row `state.NORMAL`),
              and the rows of the law from the index `first` on. The latter are zero
              when a contact begins.

The effect of a rolling law on bodies, such as whether they creep, is described in its
entry of `laws.ROLLING_LAWS` (`laws.RollingLaw`), which is read without the compiler.

`scratch[tile.GAP + lane]` is the gap of a lane, and
`lane_vector(history, state.NORMAL, lane)` is its normal. B may be a wall, whose inverse
mass and arm are 0.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numba.extending import overload

from .. import cache
from ..constants import Constant
from ..kernels.jit import INLINED

# How a contact ends: "keep" lets the damped normal force pull, while "release" and
# "cut" end the contact when the force vanishes.
KEEP, RELEASE, CUT = range(3)
TENSIONS = {"keep": KEEP, "release": RELEASE, "cut": CUT}
# Which normal force limits friction and rolling: its elastic part, or the magnitude of
# the total force, including damping.
ELASTIC, TOTAL = range(2)
FRICTION_LIMITS = {"elastic": ELASTIC, "total": TOTAL}
# The limit with which a sliding impact changes the tangential velocity by mu_s (1 + e)
# V_n (`tangential`).
COULOMB = {"keep": "elastic", "release": "total", "cut": "total"}
# Descriptions of both options for people.
LIMITS = {
    "elastic": "the elastic part of the normal force",
    "total": "the size of the damped normal force",
}
ENDS = {
    "keep": "the damped force may pull at the end of an impact",
    "release": "the force never pulls, damped so that the restitution is as set",
}

_INLINED: Any = INLINED
# Functions of the laws by the type of their options.
_KERNELS: dict[type, Callable] = {}
_REACHES: dict[type, Callable] = {}
_GEOMETRIES: dict[type, Callable] = {}


@dataclass(frozen=True)
class Law:
    """A force law.

    Parameters
    ----------
    name : str
        Name of the law, by which users choose it.
    options : type
        A named tuple class of this law alone, with the fields tension and
        friction_limit: the kernel gets an instance.
    constants : callable
        Function (material, material, contact, tension) -> array (n_constants,) that
        computes the constants of two materials for the kernel.
    n_constants : int
        Number of these constants. They are in the first rows of the law in a tile.
    n_rows : int
        Rows of a tile that the law uses, constants included.
    n_state : int
        Rows that the law keeps for each contact from step to step. They are zero when a
        contact begins.
    kernel : function
        Function (options, scratch, history, first, dt) -> None that numba can compile.
        It computes the forces in the tiles `scratch` and `history`. `first` is the
        index of the law's first row in `history`, and `dt` the time step [s].
    words : mapping
        Description of the law for reports: one sentence for each direction, such as
        ``normal``. In it, ``{limit}`` stands for the normal force that limits friction.
        A material card identifies its laws by these sentences only, so they must differ
        between contact laws, and between rolling laws.
    limits, ends : mapping
        For a contact law, descriptions of the limit of friction and of the end of an
        impact; by default those without cohesion.
    contact_time : callable, optional
        For a contact law, a function (material, material, contact, mass, radius, speed)
        -> duration of a head-on impact [s].
    oscillator : callable, optional
        For a contact law, a function (material, material, contact, tension, radius,
        overlap) -> stiffness [N/m] and damping ratio for small motions about an
        overlap.
    asks : tuple of Constant
        Further constants of two materials that the law needs from `Contact.constants`.
    reach : callable, optional
        For a law that attracts across a gap, a function (options, history, first, lane)
        -> gap at which a contact ends. The gap is below 1 m, and 0 until the contact
        has borne a force. Without this function, contacts end when the surfaces part.
    geometry : callable, optional
        Function (options, scratch, history, of_spheres, on_wall) -> None that is called
        before the kernel. It computes quantities of the surfaces other than R*.
    """

    name: str
    options: type
    constants: Callable[..., np.ndarray]
    n_constants: int
    n_rows: int
    n_state: int
    kernel: Callable[..., None]
    words: Mapping[str, str] = field(compare=False)
    limits: Mapping[str, str] = field(default_factory=LIMITS.copy, compare=False)
    ends: Mapping[str, str] = field(default_factory=ENDS.copy, compare=False)
    contact_time: Callable[..., float] | None = None
    oscillator: Callable[..., tuple[float, float]] | None = None
    asks: tuple[Constant, ...] = ()
    reach: Callable[..., float] | None = None
    geometry: Callable[..., None] | None = None

    def __post_init__(self) -> None:
        cache.add_law_sources(self.kernel, self.reach, self.geometry)
        _KERNELS[self.options] = self.kernel
        _REACHES[self.options] = self.reach or _no_reach
        _GEOMETRIES[self.options] = self.geometry or _no_geometry

    def make_options(
        self, tension: str = "keep", friction_limit: str | None = None
    ) -> Any:
        """Return the options that are passed to the kernel.

        Parameters
        ----------
        tension : {"keep", "release", "cut"}
            How a contact ends, see `Simulation`.
        friction_limit : {"elastic", "total"}, optional
            Which normal force limits friction and rolling, see `Simulation`. The
            default is the entry of `COULOMB` for this tension.

        Returns
        -------
        namedtuple
            An instance of `options`, with numbers in place of the names.
        """
        if friction_limit is None:
            friction_limit = COULOMB[tension]
        return self.options(TENSIONS[tension], FRICTION_LIMITS[friction_limit])


def contact_forces(
    law: Any, scratch: np.ndarray, history: np.ndarray, first: int, dt: float
) -> None:
    """Compute the force on body A in each lane, and the force that limits rolling.

    Both are written to the rows `TO_A` and `PUSH` of `scratch`. The radius of the
    contact circle is written to `CIRCLE`.

    Parameters
    ----------
    law : namedtuple
        The options of a law.
    scratch : ndarray
        What is computed in this step for 32 contacts, rows as `repose.dem.kernels.tile`
        names them.
    history : ndarray
        What the contacts keep from step to step.
    first : int
        Index in `history` at which the rows of the law begin.
    dt : float
        Time step [s].
    """
    _KERNELS[type(law)](law, scratch, history, first, dt)


def rolling_resistance(
    law: Any, scratch: np.ndarray, history: np.ndarray, first: int, dt: float
) -> None:
    """Compute the rolling resistance of each lane's contact on both bodies.

    It is called when the torques of the contact forces are known. A law either writes a
    budget of torque to the row `ROLL` of `TO_A` and `TO_B`, or adds to the torques and
    writes a budget of zero.

    Parameters
    ----------
    law : namedtuple
        The options of a law.
    scratch : ndarray
        What is computed in this step for 32 contacts, rows as `repose.dem.kernels.tile`
        names them.
    history : ndarray
        What the contacts keep from step to step.
    first : int
        Index in `history` at which the rows of the law begin.
    dt : float
        Time step [s].
    """
    _KERNELS[type(law)](law, scratch, history, first, dt)


def _no_reach(law, history, first, lane):
    """Return 0.0 [m], since contacts without attraction end when the surfaces part."""
    return 0.0


def _no_geometry(law, scratch, history, of_spheres, on_wall):
    """Do nothing, since the law needs only the gap, the normal and R*."""
    return None


def reach(law: Any, history: np.ndarray, first: int, lane: int) -> float:
    """Return the gap at which the contact of a lane ends [m].

    Parameters
    ----------
    law : namedtuple
        The options of a contact law.
    history : ndarray
        What the contacts keep from step to step.
    first : int
        Index in `history` at which the rows of the law begin.
    lane : int
        Lane of the contact in its tile, 0 to LANES - 1.
    """
    return _REACHES[type(law)](law, history, first, lane)


def surfaces(
    law: Any, scratch: np.ndarray, history: np.ndarray, of_spheres: int, on_wall: int
) -> None:
    """Compute quantities of each lane's surfaces that a law needs in addition to R*.

    It is called before `contact_forces`.

    Parameters
    ----------
    law : namedtuple
        The options of a contact law.
    scratch, history : ndarray
        The tiles of 32 contacts, see `contact_forces`.
    of_spheres : int
        1 for contacts of spheres of clumps, 0 for those of smooth bodies.
    on_wall : int
        1 if body B is a wall, otherwise 0.
    """
    _GEOMETRIES[type(law)](law, scratch, history, of_spheres, on_wall)


def _dispatch_in_kernels(
    function: Callable, implementations: Mapping[Any, Callable]
) -> None:
    """Let numba replace each call of a function by the implementation for a law.

    The implementation is found by the type of the options, the first argument of the
    call.

    Parameters
    ----------
    function : callable
        A function that kernels call, such as `contact_forces`.
    implementations : mapping
        The function of each law, by the type of its options. Laws may be added later.
    """

    def choose(law: Any, *_arguments: Any) -> Callable | None:
        return implementations.get(getattr(law, "instance_class", None))

    overload(function, jit_options=_INLINED, strict=False)(choose)


_dispatch_in_kernels(contact_forces, _KERNELS)
_dispatch_in_kernels(rolling_resistance, _KERNELS)
_dispatch_in_kernels(reach, _REACHES)
_dispatch_in_kernels(surfaces, _GEOMETRIES)
