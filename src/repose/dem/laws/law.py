"""A force law: its data, and the kernel that computes its forces.

The engine calls `contact_forces` and `rolling_resistance` with the options of a law.
The options of each law are a named tuple of a type of its own. By this type numba puts
the kernel of the law in place of the call, so a compiled loop has the code of one law
only.

A kernel computes 32 contacts at a time, each in one lane of two tiles (`kernels.rows`
explains tiles):

    scratch   what is computed in this step: copies of the two bodies A and B, the
              geometry, and the forces (rows of `kernels.tile`). The constants of the
              contact law lie from row `tile.LAW` on, those of the rolling law from
              `tile.ROLLING` on.
    history   what the contacts keep from step to step: the normal (row `state.NORMAL`),
              and the rows of the law from a place `first` on. The latter are zero when
              a contact begins.

What a rolling law does to bodies, such as whether they creep under it, stands in its
entry of `laws.ROLLING_LAWS` (`laws.RollingLaw`), which is read without the compiler.

`scratch[tile.GAP + lane]` is the gap of a lane, and
`lane_vector(history, state.NORMAL, lane)` is its normal. B may be a wall: it has no inverse mass, and its arm is 0.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numba.extending import overload

from .. import cache
from ..constants import Constant
from ..kernels.jit import INLINED

# How a contact ends: "keep" lets the damped normal force pull, "release" and "cut" end
# it when the force vanishes.
KEEP, RELEASE, CUT = range(3)
TENSIONS = {"keep": KEEP, "release": RELEASE, "cut": CUT}
# Which normal force limits friction and rolling: its elastic part, or the size of all
# of it, damping included.
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
        (material, material, contact, tension) -> array (n_constants,): constants of two
        materials for the kernel.
    n_constants : int
        Number of these constants. They are in the first rows of the law in a tile.
    n_rows : int
        Rows of a tile that the law uses, constants included.
    n_state : int
        Rows that the law keeps for each contact from step to step. They are zero when a
        contact begins.
    kernel : function
        (options, scratch, history, first, dt) -> None, a plain function that numba can
        compile. scratch, history: the tiles; first: place of the law's first row in
        history; dt: time step [s].
    words : mapping
        Text for people: for each direction, such as ``normal``, one sentence, in which
        ``{limit}`` stands for the normal force that limits friction. A material card
        names its laws by these sentences only, so no two contact laws have the same
        sentences, and no two rolling laws.
    limits, ends : mapping
        Of a contact law, text for people: the limit of friction, and the end of an
        impact; by default those without cohesion.
    contact_time : callable, optional
        (material, material, contact, mass, radius, speed) -> duration of a head-on
        impact [s], of a contact law.
    oscillator : callable, optional
        (material, material, contact, tension, radius, overlap) -> stiffness [N/m] and
        damping ratio of a contact for small motions about an overlap, of a contact law.
    asks : tuple of Constant
        Further constants that the law needs of two materials, from `Contact.constants`.
    reach : callable, optional
        (options, history, first, lane) -> gap [m] at which a contact ends, 0 until it
        has borne a force, below 1 m; of a law that attracts across a gap. Other
        contacts end when the surfaces part.
    geometry : callable, optional
        (options, scratch, history, of_spheres, on_wall) -> None, called before the
        kernel: further quantities of the surfaces besides R*.
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
        """Return the options that the kernel gets.

        Parameters
        ----------
        tension : {"keep", "release", "cut"}
            How a contact ends, see `Simulation`.
        friction_limit : {"elastic", "total"}, optional
            Which normal force limits friction and rolling, see `Simulation`; by default
            that of `COULOMB`.

        Returns
        -------
        namedtuple
            An instance of `options`, with numbers for the names.
        """
        if friction_limit is None:
            friction_limit = COULOMB[tension]
        return self.options(TENSIONS[tension], FRICTION_LIMITS[friction_limit])


def contact_forces(
    law: Any, scratch: np.ndarray, history: np.ndarray, first: int, dt: float
) -> None:
    """Compute the force on body A in each lane, and the force that limits rolling.

    Both are written to the rows `TO_A` and `PUSH` of `scratch`. The radius of the contact
    circle is written to `CIRCLE`.

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
    """Return 0.0 [m]: without attraction contacts end when the surfaces part."""
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
    """Compute quantities of each lane's surfaces that a law needs besides R*.

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
        1 where body B is a wall, else 0.
    """
    _GEOMETRIES[type(law)](law, scratch, history, of_spheres, on_wall)


def _dispatch_in_kernels(
    function: Callable, implementations: Mapping[Any, Callable]
) -> None:
    """Let numba put the implementation of a law in place of each call of a function.

    The implementation is found by the type of the options, the call's first argument.

    Parameters
    ----------
    function : callable
        A function that kernels call, such as `contact_forces`.
    implementations : mapping
        Function of each law, by the type of its options. Laws may be added later.
    """

    def choose(law: Any, *_arguments: Any) -> Callable | None:
        return implementations.get(getattr(law, "instance_class", None))

    overload(function, jit_options=_INLINED, strict=False)(choose)


_dispatch_in_kernels(contact_forces, _KERNELS)
_dispatch_in_kernels(rolling_resistance, _KERNELS)
_dispatch_in_kernels(reach, _REACHES)
_dispatch_in_kernels(surfaces, _GEOMETRIES)
