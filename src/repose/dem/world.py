"""Make the parts of a simulation: force laws, materials, bodies, walls and contacts."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from . import contact_lists, time_steps
from .checks import (
    check_box,
    check_height,
    check_mapping,
    check_number,
    check_positive,
    check_vector,
    check_whole_number,
    look_up_choice,
)
from .contact_table import (
    check_constants,
    index_contacts,
    number_materials,
    tabulate_constants,
)
from .kernels import clumps, features, parallel, state, tile
from .kernels.body_tile import TILE_ROWS
from .laws import CONTACT_LAWS, ROLLING_LAWS
from .laws.law import COULOMB, FRICTION_LIMITS, TENSIONS, Law
from .materials import Contact, Material
from .shapes import Clump, Shape, are_clumps, count_ellipsoids, count_most_spheres
from .walls import Mesh, Wall, WallSet, make_wall_arrays

SKIN_SHARE = 0.45  # skin of the list of near pairs, over the largest bounding radius


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
        """Check the arguments, which `Simulation` describes, and make all parts.

        Each step uses attributes that the steps before it have set, so their order
        matters.
        """
        self.shapes = check_mapping("shapes", shapes, Shape | Clump, "Shape or Clump")
        self.materials = check_mapping("materials", materials, Material, "Material")
        self._has_clumps = are_clumps(self.shapes)
        self._choose_laws(contact_law, rolling_law, tension, friction_limit)
        self.capacity = check_whole_number("capacity", capacity, 1)
        self.largest_scale = check_positive("largest_scale", largest_scale)
        self.lower, self.upper = check_box(lower, upper)
        self.wall_set = WallSet({} if walls is None else walls)
        self._pair_materials(contacts)
        # The longest allowed time step depends on the shapes, materials and laws.
        time_step = self._check_time_step(time_step_s)

        self._make_body_arrays()
        self._make_wall_arrays()
        self._make_contact_lists()
        self.counts = np.zeros(state.COUNTS, np.int64)
        self.physics = self._make_physics(
            time_step,
            gravity=check_vector("gravity_m_s2", gravity_m_s2),
            exit_height=check_height("exit_height_m", exit_height_m),
            curved_walls_above=check_height(
                "curved_walls_above_m", curved_walls_above_m
            ),
            floor_height=check_height("floor_height_m", floor_height_m),
        )
        # The setter checks the number, and makes working memory for each thread.
        self.threads = threads

    def _choose_laws(
        self,
        contact_law: str,
        rolling_law: str,
        tension: str,
        friction_limit: str | None,
    ) -> None:
        """Look up the force laws and check their options.

        Parameters
        ----------
        contact_law, rolling_law : str
            Names of the laws.
        tension : str
            How a contact ends, see `Simulation`.
        friction_limit : str or None
            Which normal force limits friction. If it is None, it is the one with which
            a sliding impact obeys Coulomb's law for this tension (table COULOMB).

        Raises
        ------
        ValueError
            If a name is unknown.
        """
        # `look_up_choice` is called only to reject unknown names. Its result is not
        # used, since these options are stored by name.
        look_up_choice("tension", tension, TENSIONS)
        if friction_limit is None:
            friction_limit = COULOMB[tension]
        look_up_choice("friction_limit", friction_limit, FRICTION_LIMITS)
        self.tension = tension
        self.friction_limit = friction_limit
        self.contact_law: Law = look_up_choice("contact_law", contact_law, CONTACT_LAWS)
        self.rolling_law: Law = look_up_choice("rolling_law", rolling_law, ROLLING_LAWS)

    @property
    def _n_history_rows(self) -> int:
        """Number of rows that the force laws keep for each contact."""
        return self.contact_law.n_state + self.rolling_law.n_state

    def _pair_materials(self, contacts: Mapping[tuple[str, str], Contact]) -> None:
        """Assign numbers to the materials, and check the contacts of their pairs."""
        self.contact_pairs = index_contacts(contacts, self.materials)
        self._material_numbers = number_materials(
            self.shapes, self._list_wall_materials(), self.materials, self.contact_pairs
        )
        check_constants(self.contact_law, self._material_numbers, self.contact_pairs)

    def _list_wall_materials(self) -> list[str]:
        """List the material of each wall."""
        return [surface.material for surface in self.wall_set.surfaces.values()]

    def _check_time_step(self, time_step_s: float) -> float:
        """Return the time step if it is short enough; otherwise raise ValueError.

        Two attributes are set: `scene`, on which the longest time step depends, and
        `_smallest_scales`, the smallest scale of each shape with this time step.
        """
        self.scene = time_steps.Scene(
            law=self.contact_law,
            tension=self.tension,
            materials=self.materials,
            contacts=self.contact_pairs,
            shapes=self.shapes,
            walls=frozenset(self._list_wall_materials()),
        )
        limit = time_steps.compute_longest(self.scene)
        time_step = check_number(
            "time_step_s",
            time_step_s,
            allowed=f"above 0, {limit.allowed}",
            accepts=lambda step: 0.0 < step <= limit.time_step_s,
        )
        self._smallest_scales = time_steps.smallest_scales(self.scene, time_step)
        return time_step

    def _make_body_arrays(self) -> None:
        """Make empty arrays of the bodies, and the grid of the search for neighbours.

        These are the arrays of the engine, the shape and scale of each body, and the
        indices that translate between the order of the user and that of the engine.
        """
        # A large simulation of smooth bodies divides the work of a step into shares,
        # whatever the number of threads, and renumbers its bodies from time to time.
        # Two arrays translate between the indices of the engine and those of the user.
        is_large = self.capacity >= parallel.FEWEST_BODIES
        self._runs_in_shares = is_large and not self._has_clumps
        self._engine_numbers = np.arange(self.capacity)
        self._user_numbers = np.arange(self.capacity)

        n_shares = parallel.SHARES if self._runs_in_shares else 1
        parts = count_ellipsoids(self.shapes.values())
        self.bodies = state.new_bodies(self.capacity, parts, n_shares)
        self._shape_ids = np.zeros(self.capacity, np.int32)
        self._scales = np.ones(self.capacity)

        # The centres of two touching bodies are at most `reach` apart. Pairs are listed
        # as near up to a gap of one skin. With cells of this size, two bodies of a near
        # pair are in the same cell or in neighbouring ones.
        bounding_radii = [shape.bounding_radius_m for shape in self.shapes.values()]
        self.radius = self.largest_scale * max(bounding_radii)
        reach = 2.0 * self.radius
        skin = SKIN_SHARE * self.radius
        self.grid = state.new_grid(self.capacity, self.lower, self.upper, reach + skin)
        self.grid.lengths[state.REACH] = reach
        self.grid.lengths[state.SKIN] = skin

    def _make_wall_arrays(self) -> None:
        """Make the arrays of the walls and of the features of meshes."""
        self.walls = self._make_walls()
        # An empty tuple tells the kernels that there are no meshes.
        self.meshes: Any = ()
        mesh_walls = self.wall_set.list_walls(Mesh)
        if mesh_walls:
            slide = max(shape.slide for shape in self.shapes.values())
            self.meshes = features.join_features(
                [mesh.part for mesh in mesh_walls], slide
            )

    def _make_walls(
        self, old_walls: state.Walls | None = None, changed_wall: int = -1
    ) -> state.Walls:
        """Make the arrays of the walls for the kernels.

        Parameters
        ----------
        old_walls : Walls, optional
            Arrays of the same walls in a running simulation, see
            `walls.make_wall_arrays`. None stands for the beginning of a simulation.
        changed_wall : int
            Number of the wall whose motion has changed; -1 for none.
        """
        box_size = float(np.linalg.norm(self.upper - self.lower))
        return make_wall_arrays(
            self.wall_set,
            self._material_numbers.all_materials,
            box_size,
            old_walls,
            changed_wall,
        )

    def _make_contact_lists(self) -> None:
        """Make empty lists of contacts between bodies and with walls."""
        shapes = list(self.shapes.values())
        self._most_spheres = count_most_spheres(shapes)
        self.pairs = contact_lists.new_pairs(
            self.capacity, self._most_spheres, self._n_history_rows
        )
        # Contacts with planes (`flat`), with curved walls (`curved`) and with meshes
        # (`meshed`) are in separate lists.
        n_planes = len(self.walls.planes)
        n_curved = len(self.walls.cones) + len(self.walls.rings)
        n_meshes = len(self.wall_set.list_walls(Mesh))
        self.flat, self.curved, self.meshed = contact_lists.new_wall_contacts(
            self.capacity,
            (n_planes, n_curved, n_meshes),
            self._has_clumps,
            self._n_history_rows,
        )
        # An empty tuple tells the kernels that the bodies are smooth. For clumps, the
        # array `mesh_sphere` must be as long as the list of contacts with meshes, so
        # this comes last.
        self.clumps: Any = ()
        if self._has_clumps:
            self.clumps = clumps.new_clumps(
                shapes, self._shape_ids, self._scales, len(self.meshed.body)
            )

    def _make_physics(
        self,
        time_step: float,
        *,
        gravity: np.ndarray,
        exit_height: float,
        curved_walls_above: float,
        floor_height: float,
    ) -> state.Physics:
        """Make the record of constants that the kernels need in each time step.

        Parameters
        ----------
        time_step : float
            Length of a time step [s].
        gravity : ndarray (3,)
            Acceleration [m/s2].
        exit_height, curved_walls_above, floor_height : float
            Heights [m], as described in `Simulation`.
        """
        has_mixed_bodies = len(self._material_numbers.body_materials) > 1
        has_mixed_walls = len(set(self._list_wall_materials())) > 1
        return state.Physics(
            parts=count_ellipsoids(self.shapes.values()),
            gravity=gravity,
            law=self.contact_law.make_options(self.tension, self.friction_limit),
            rolling=self.rolling_law.make_options(self.tension, self.friction_limit),
            law_constants=self._tabulate_constants(self.contact_law),
            rolling_constants=self._tabulate_constants(self.rolling_law),
            n_state=self.contact_law.n_state,
            mixed_pairs=has_mixed_bodies,
            mixed_walls=has_mixed_bodies or has_mixed_walls,
            dt=time_step,
            rolling_frame=np.zeros(3),
            exit_height=exit_height,
            curved_walls_above=curved_walls_above,
            floor_height=floor_height,
        )

    def _tabulate_constants(self, law: Law) -> np.ndarray:
        """Compute a law's constants for all pairs of materials."""
        return tabulate_constants(
            law,
            self._material_numbers,
            self.materials,
            self.contact_pairs,
            self.tension,
        )

    @property
    def threads(self) -> int:
        """Number of threads that share the work of a large simulation (4096 bodies)."""
        return len(self._tiles)

    @threads.setter
    def threads(self, threads: int) -> None:
        is_whole = isinstance(threads, int | np.integer)
        if not (is_whole and 1 <= threads <= parallel.SHARES):
            raise ValueError(f"threads is {threads!r}; expected 1 to {parallel.SHARES}")
        # Each thread needs scratch arrays of its own.
        rows = tile.LAW_ROW + self.contact_law.n_rows
        self._tiles = state.aligned_zeros(threads, rows * state.LANES)
        self._body_tiles = state.aligned_zeros(threads, TILE_ROWS * state.LANES)
        self._scratches = state.aligned_zeros(threads, state.SCRATCH)
