"""What a simulation consists of: its laws and materials, and the arrays of bodies, walls and contacts."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from . import contact_lists, time_steps
from .checks import box, chosen, height, mapping, number, positive, vector, whole_number
from .contact_table import check_constants, constants_of, number_materials, pairs_of
from .kernels import clumps as cl
from .kernels import features, parallel
from .kernels import state as st
from .kernels import tile as tl
from .kernels.body_tile import TILE_ROWS
from .laws import CONTACT_LAWS, ROLLING_LAWS
from .laws.law import COULOMB, FRICTION_LIMITS, TENSIONS
from .materials import Contact, Material
from .shapes import Clump, Shape, are_clumps, most_spheres, parts_of
from .walls import Mesh, Wall, WallSet, wall_arrays

SKIN_SHARE = 0.45  # skin of the neighbour list over the largest bounding radius


class World:
    """The parts of a `repose.dem.Simulation`, which describes the arguments."""

    def __init__(
        self,
        shapes: Mapping[str, Shape] | Mapping[str, Clump],
        materials: Mapping[str, Material],
        contacts: Mapping[tuple[str, str], Contact],
        time_step_s: float,
        *,
        capacity: int,
        lower: ArrayLike,
        upper: ArrayLike,
        walls: Mapping[str, Wall] | None = None,
        gravity_m_s2: ArrayLike = (0.0, 0.0, -9.81),
        tension: str = "keep",
        friction_limit: str | None = None,
        contact_law: str = "hertz_mindlin",
        rolling_law: str = "budget",
        largest_scale: float = 1.0,
        threads: int = 1,
        exit_height_m: float = -math.inf,
        curved_walls_above_m: float = -math.inf,
        floor_height_m: float = -math.inf,
    ) -> None:
        self.shapes = mapping("shapes", shapes, Shape | Clump, "Shape or Clump")
        self.materials = mapping("materials", materials, Material, "Material")
        self._of_clumps = are_clumps(self.shapes)
        self._choose_laws(contact_law, rolling_law, tension, friction_limit)
        self.capacity = whole_number("capacity", capacity, 1)
        self.largest_scale = positive("largest_scale", largest_scale)
        self.lower, self.upper = box(lower, upper)
        self.radius = self.largest_scale * max(
            shape.bounding_radius_m for shape in self.shapes.values()
        )
        self.wall_set = WallSet({} if walls is None else walls)
        self.contact_pairs = pairs_of(contacts, self.materials)
        of_walls = [surface.material for surface in self.wall_set.surfaces.values()]
        self._numbers = number_materials(
            self.shapes, of_walls, self.materials, self.contact_pairs
        )
        check_constants(self.contact_law, self._numbers, self.contact_pairs)
        self.scene = time_steps.Scene(
            self.contact_law,
            tension,
            self.materials,
            self.contact_pairs,
            self.shapes,
            frozenset(of_walls),
        )
        limit = time_steps.longest(self.scene)
        steps = f"above 0, {limit.allowed}"
        dt = number(
            "time_step_s", time_step_s, steps, lambda dt: 0.0 < dt <= limit.time_step_s
        )
        self._smallest_scales = time_steps.smallest_scales(self.scene, dt)
        parts = parts_of(self.shapes.values())
        self._make_arrays(parts)
        several = len(self._numbers.of_bodies) > 1
        options = tension, self.friction_limit
        of_pairs = self._numbers, self.materials, self.contact_pairs, tension
        self.physics = st.Physics(
            parts=parts,
            gravity=vector("gravity_m_s2", gravity_m_s2),
            law=self.contact_law.make_options(*options),
            rolling=self.rolling_law.make_options(*options),
            law_constants=constants_of(self.contact_law, *of_pairs),
            rolling_constants=constants_of(self.rolling_law, *of_pairs),
            n_state=self.contact_law.n_state,
            mixed_pairs=several,
            mixed_walls=several or len(set(of_walls)) > 1,
            dt=dt,
            rolling_frame=np.zeros(3),
            exit_height=height("exit_height_m", exit_height_m),
            curved_walls_above=height("curved_walls_above_m", curved_walls_above_m),
            floor_height=height("floor_height_m", floor_height_m),
        )
        self.threads = threads

    def _choose_laws(
        self,
        contact_law: str,
        rolling_law: str,
        tension: str,
        friction_limit: str | None,
    ) -> None:
        """Keep the force laws of these names and their options, or ValueError."""
        chosen("tension", tension, TENSIONS)
        if friction_limit is None:
            friction_limit = COULOMB[tension]
        chosen("friction_limit", friction_limit, FRICTION_LIMITS)
        self.tension, self.friction_limit = tension, friction_limit
        self.contact_law = chosen("contact_law", contact_law, CONTACT_LAWS)
        self.rolling_law = chosen("rolling_law", rolling_law, ROLLING_LAWS)

    def _make_arrays(self, parts: int) -> None:
        """Make the arrays of bodies, walls and contacts, all of them empty; parts: see `shapes.parts_of`."""
        skin = SKIN_SHARE * self.radius
        self._shared = self.capacity >= parallel.FEWEST_BODIES and not self._of_clumps
        self._inner, self._outer = np.arange(self.capacity), np.arange(self.capacity)
        self.bodies = st.new_bodies(
            self.capacity, parts, parallel.SHARES if self._shared else 1
        )
        self._shape_ids = np.zeros(self.capacity, np.int32)
        self._scales = np.ones(self.capacity)
        self.grid = st.new_grid(
            self.capacity, self.lower, self.upper, 2.0 * self.radius + skin
        )
        self.grid.lengths[st.REACH :] = 2.0 * self.radius, skin
        self.walls = self._wall_arrays()
        surfaces = self.wall_set.of(Mesh)
        shapes = list(self.shapes.values())
        slide = max(shape.slide for shape in shapes)
        self.meshes: Any = (
            features.join([mesh.part for mesh in surfaces], slide) if surfaces else ()
        )
        n_walls = (
            len(self.walls.planes),
            len(self.walls.cones) + len(self.walls.rings),
            len(surfaces),
        )
        self._most_spheres = most_spheres(shapes)
        self.pairs = contact_lists.new_pairs(
            self.capacity, self._most_spheres, self._n_state
        )
        of_walls = contact_lists.new_wall_contacts(
            self.capacity, n_walls, self._of_clumps, self._n_state
        )
        self.flat, self.curved, self.meshed = of_walls
        self.clumps: Any = ()
        if self._of_clumps:
            self.clumps = cl.new_clumps(
                shapes, self._shape_ids, self._scales, len(self.meshed.body)
            )
        self.counts = np.zeros(st.COUNTS, np.int64)

    @property
    def _n_state(self) -> int:
        """Count the rows that the force laws keep for each contact."""
        return self.contact_law.n_state + self.rolling_law.n_state

    def _wall_arrays(self, old: st.Walls | None = None, changed: int = -1) -> st.Walls:
        """Make the walls as the kernels take them, where they are now; `changed` has another motion."""
        size = float(np.linalg.norm(self.upper - self.lower))
        return wall_arrays(self.wall_set, self._numbers.of_all, size, old, changed)

    @property
    def threads(self) -> int:
        """Number of threads that share the work of a simulation of 4096 bodies or more."""
        return len(self._tiles)

    @threads.setter
    def threads(self, threads: int) -> None:
        if not (
            isinstance(threads, int | np.integer) and 1 <= threads <= parallel.SHARES
        ):
            raise ValueError(f"threads is {threads!r}; expected 1 to {parallel.SHARES}")
        rows = tl.LAW_ROW + self.contact_law.n_rows
        self._tiles = st.zeros(threads, rows * st.LANES)
        self._body_tiles = st.zeros(threads, TILE_ROWS * st.LANES)
        self._scratches = st.zeros(threads, st.SCRATCH)
