"""Read the results of a simulation: its bodies, contacts, and loads on walls."""

from copy import deepcopy
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .checks import check_vector
from .kernels import clump_tile, state
from .kernels.engine import add_wall_loads
from .rotations import rotation_matrices
from .world import World


class WallLoad(NamedTuple):
    """The load of the bodies on a wall.

    Attributes
    ----------
    force_n : ndarray (3,)
        Sum of the forces of the bodies [N].
    torque_n_m : ndarray (3,)
        Torque of these forces about a point [N m]. It includes the rolling couples if
        the rolling law acts between two bodies.
    """

    force_n: np.ndarray
    torque_n_m: np.ndarray


class Observables(World):
    """The results of a `Simulation`."""

    def __repr__(self) -> str:
        return (
            f"<Simulation: {self.n_bodies} bodies, {len(self.wall_set.names)} walls, "
            f"{self.contact_law.name}, {self.rolling_law.name}, {self.time_s:g} s>"
        )

    @property
    def n_bodies(self) -> int:
        """Number of bodies added so far."""
        return int(self.counts[state.N_BODIES])

    @property
    def steps(self) -> int:
        """Number of time steps made."""
        return int(self.counts[state.STEPS])

    @property
    def time_step_s(self) -> float:
        """Length of a time step [s]."""
        return float(self.physics.dt)

    @property
    def time_s(self) -> float:
        """Simulated time [s]."""
        return self.steps * self.time_step_s

    @property
    def positions(self) -> np.ndarray:
        """Centres of the bodies added so far (N, 3) [m].

        The array is a view in simulations of fewer than 4096 bodies.
        """
        return self._in_user_order(self.bodies.rows)[
            :, state.POSITION : state.POSITION + 3
        ]

    @property
    def quaternions(self) -> np.ndarray:
        """Orientations (w, x, y, z), body to world, a copy (N, 4)."""
        quaternions = state.copy_motion(
            self.bodies.motion, state.QUATERNION, 4, self.n_bodies
        )
        return self._in_user_order(quaternions)

    @property
    def velocities(self) -> np.ndarray:
        """Velocities of the centres (N, 3) [m/s]; a view if `positions` is one."""
        return self._in_user_order(self.bodies.rows)[
            :, state.VELOCITY : state.VELOCITY + 3
        ]

    @property
    def angular_velocities(self) -> np.ndarray:
        """Angular velocities in the world frame (N, 3) [rad/s].

        The array is a view if `positions` is one.
        """
        rows = self._in_user_order(self.bodies.rows)
        return rows[:, state.ANGULAR_VELOCITY : state.ANGULAR_VELOCITY + 3]

    @property
    def angular_momenta(self) -> np.ndarray:
        """Angular momenta about the centres, in the world [kg m2/s], a copy (N, 3)."""
        momenta = state.copy_motion(
            self.bodies.motion, state.ANGULAR_MOMENTUM, 3, self.n_bodies
        )
        return self._in_user_order(momenta)

    @property
    def shape_ids(self) -> np.ndarray:
        """Index of each body's shape among the names of `shapes`, a view (N,)."""
        return self._shape_ids[: self.n_bodies]

    @property
    def scales(self) -> np.ndarray:
        """Scale of each body, a view (N,)."""
        return self._scales[: self.n_bodies]

    @property
    def present(self) -> np.ndarray:
        """Whether each body is still there (N,)."""
        return self._in_user_order(self.bodies.presence) == state.PRESENT

    @property
    def exit_times_s(self) -> np.ndarray:
        """Time at which each body fell through the exit height (N,) [s].

        It is NaN for a body that has not done so.
        """
        return self._in_user_order(self.bodies.exit_time)

    def _in_user_order(self, values: np.ndarray) -> np.ndarray:
        """Return values of the bodies in the order in which they were added.

        The result is a view if the engine has the same order.
        """
        if self._runs_in_shares:
            return values[self._engine_numbers[: self.n_bodies]]
        return values[: self.n_bodies]

    @property
    def masses_kg(self) -> np.ndarray:
        """Mass of each body, a copy (N,) [kg]; 0 for a body that is gone."""
        inverse = self._in_user_order(self.bodies.rows)[:, state.INVERSE_MASS]
        return np.divide(1.0, inverse, out=np.zeros_like(inverse), where=inverse > 0.0)

    def kinetic_energies(self) -> np.ndarray:
        """Compute the kinetic energy of each body's translation and rotation.

        Returns
        -------
        ndarray (N,)
            The energies [J].
        """
        translation = 0.5 * self.masses_kg * np.sum(self.velocities**2, axis=1)
        rotation = 0.5 * np.sum(self.angular_momenta * self.angular_velocities, axis=1)
        return translation + rotation

    def contacts(self) -> np.ndarray:
        """List the pairs of bodies that touch.

        Returns
        -------
        ndarray (M, 2)
            Indices of the two bodies, the smaller one first. The rows are sorted.
        """
        # `pairs.first` and `pairs.second` list the touching pairs; near pairs are in
        # other arrays.
        n_pairs = self.counts[state.N_PAIRS]
        first = self.pairs.first[:n_pairs]
        second = self.pairs.second[:n_pairs]
        # The engine may have renumbered the bodies. `_user_numbers` turns its indices
        # into those that `add` returned. The indexing makes a copy, which can be sorted
        # in place.
        pairs = self._user_numbers[np.column_stack([first, second])]
        pairs.sort(axis=1)
        # Several spheres of two clumps may touch. `np.unique` lists such a pair once,
        # and sorts the rows.
        if self._has_clumps:
            return np.unique(pairs, axis=0)
        order = np.lexsort((pairs[:, 1], pairs[:, 0]))  # by the first, then the second
        return pairs[order]

    def sphere_contacts(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """List the pairs of touching spheres of clumps; smooth bodies have none.

        Returns
        -------
        bodies : ndarray (M, 2)
            Indices of the two bodies, the smaller first.
        spheres : ndarray (M, 2)
            Indices of their spheres.
        normals : ndarray (M, 3)
            Unit vectors from the first body to the second.
        """
        n_pairs = int(self.counts[state.N_PAIRS]) if self._has_clumps else 0
        first = self.pairs.first[:n_pairs]
        second = self.pairs.second[:n_pairs]
        bodies = np.column_stack([first, second])
        # Smooth bodies have no array of spheres, so an empty one takes its place.
        # Clumps are never renumbered by the engine.
        spheres = self.pairs.spheres[:n_pairs] if n_pairs else np.zeros((0, 2))
        # The first three rows of a contact are its normal.
        normals = state.contact_rows(self.pairs.data, n_pairs)[:, :3].copy()
        return bodies.astype(np.int64), spheres.astype(np.int64), normals

    def overlaps(self) -> tuple[np.ndarray, np.ndarray]:
        """Compute the overlaps of bodies, along the normals of the last step.

        Returns
        -------
        bodies : ndarray (M, 2)
            Indices of the two bodies. Two clumps have one row for each of their
            contacts.
        overlaps : ndarray (M,)
            The overlaps [m].
        """
        n_pairs = int(self.counts[state.N_PAIRS])
        # The engine may have renumbered the bodies. `_user_numbers` turns its indices
        # into those that `add` returned.
        first = self._user_numbers[self.pairs.first[:n_pairs]]
        second = self._user_numbers[self.pairs.second[:n_pairs]]
        # The first three rows of a contact are its normal, from the first body to the
        # second.
        normals = state.contact_rows(self.pairs.data, n_pairs)[:, :3]
        # Smooth bodies have no spheres. Of two clumps, a contact names the spheres.
        first_spheres = second_spheres = None
        if self._has_clumps:
            first_spheres, second_spheres = self.pairs.spheres[:n_pairs].T

        # Two bodies overlap if the sum of their extents along the normal, towards each
        # other, exceeds the distance of their centres along the normal.
        first_extents = self._measure_extents(first, normals, first_spheres)
        second_extents = self._measure_extents(second, -normals, second_spheres)
        offsets = self.positions[second] - self.positions[first]
        distances = np.sum(offsets * normals, axis=1)
        overlaps = first_extents + second_extents - distances
        return np.column_stack([first, second]), overlaps

    def wall_overlaps(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Compute how deeply bodies overlap walls.

        Returns
        -------
        bodies : ndarray (M,)
            Index of the body. A clump has one row for each contact of its spheres.
        walls : ndarray (M,)
            Number of the wall in `wall_set.names`.
        overlaps : ndarray (M,)
            The overlaps [m]. Those with meshes are of the last time step.

        Notes
        -----
        At a contact, the wall is replaced by its tangent plane n.x = c. If h is the
        support function of the body and p its centre, the overlap is h(n) + n.p - c.
        """
        # Compute the overlaps kind by kind. Those with meshes were stored in the last
        # step.
        plane_bodies, planes, plane_overlaps = self._compute_plane_overlaps()
        curved_bodies, curved_walls, curved_overlaps = self._compute_curved_overlaps()
        mesh_bodies, meshes, _, _, mesh_overlaps = self.mesh_contacts()

        # The walls of each kind are numbered from 0. In `wall_set.names` planes come
        # first, then cones and rings, then meshes.
        first_curved = len(self.walls.planes)
        first_mesh = first_curved + len(self.walls.cones) + len(self.walls.rings)
        walls = np.concatenate(
            [planes, first_curved + curved_walls, first_mesh + meshes]
        )
        bodies = np.concatenate([plane_bodies, curved_bodies, mesh_bodies])
        overlaps = np.concatenate([plane_overlaps, curved_overlaps, mesh_overlaps])
        return bodies.astype(np.int64), walls.astype(np.int64), overlaps

    def _compute_plane_overlaps(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Compute the overlaps at the M contacts with planes.

        Returns
        -------
        bodies, planes : ndarray (M,)
            Index of the body, and number of the plane.
        overlaps : ndarray (M,)
            The overlaps [m].
        """
        n_contacts = int(self.counts[state.N_PLANE])
        # `flat` is the list of contacts with planes. The engine may have renumbered the
        # bodies. `_user_numbers` turns its indices into those that `add` returned.
        bodies = self._user_numbers[self.flat.body[:n_contacts]]
        planes = self.flat.wall[:n_contacts].astype(np.int64)
        # For clumps, the feature of a contact is the index of the sphere.
        spheres = self.flat.feature[:n_contacts]
        # A plane through the point p with the normal n has the equation n.x = n.p.
        plane_rows = self.walls.planes[planes]
        points = plane_rows[:, state.PLANE_POINT : state.PLANE_POINT + 3]
        normals = plane_rows[:, state.PLANE_NORMAL : state.PLANE_NORMAL + 3]
        offsets = np.sum(normals * points, axis=1)
        overlaps = self._compute_overlaps_with_planes(bodies, normals, offsets, spheres)
        return bodies, planes, overlaps

    def _compute_curved_overlaps(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Compute the overlaps at the M contacts with cones, tubes and rings.

        Returns
        -------
        bodies, walls : ndarray (M,)
            Index of the body, and number of the wall as in `curved_contacts`.
        overlaps : ndarray (M,)
            The overlaps [m].
        """
        bodies, walls, normals, azimuths = self.curved_contacts()
        walls = walls.astype(np.int64)
        spheres = self.curved.feature[: len(bodies)]
        offsets = _compute_tangent_offsets(self.walls, walls, normals, azimuths)
        overlaps = self._compute_overlaps_with_planes(bodies, normals, offsets, spheres)
        return bodies, walls, overlaps

    def _compute_overlaps_with_planes(
        self,
        bodies: np.ndarray,
        normals: np.ndarray,
        offsets: np.ndarray,
        spheres: np.ndarray,
    ) -> np.ndarray:
        """Compute the overlaps of bodies with planes n.x = offset.

        Parameters
        ----------
        bodies : ndarray (M,)
            Indices of the bodies.
        normals : ndarray (M, 3)
            Unit vectors n, from the body into the wall.
        offsets : ndarray (M,)
            Offset of each plane [m].
        spheres : ndarray (M,)
            For clumps, the sphere of each body that touches the plane.

        Returns
        -------
        ndarray (M,)
            The overlaps [m].
        """
        touching_spheres = spheres if self._has_clumps else None
        extents = self._measure_extents(bodies, normals, touching_spheres)
        distances = np.sum(normals * self.positions[bodies], axis=1)
        return extents + distances - offsets

    def _measure_extents(
        self, bodies: np.ndarray, directions: np.ndarray, spheres: np.ndarray | None
    ) -> np.ndarray:
        """Compute how far bodies extend from their centres in directions of the world.

        Parameters
        ----------
        bodies : ndarray (M,)
            Indices of the bodies.
        directions : ndarray (M, 3)
            Unit vectors.
        spheres : ndarray (M,) or None
            For clumps, the sphere of each body whose extent is computed. None for
            smooth bodies.

        Returns
        -------
        ndarray (M,)
            The extents [m].
        """
        # The shapes are described in the frames of the bodies, at scale 1. Rotate the
        # directions into these frames by the transposed (inverse) rotations, and scale
        # the extents at the end.
        rotations = rotation_matrices(self.quaternions[bodies])
        body_directions = np.einsum("nji,nj->ni", rotations, directions)
        extents = np.zeros(len(bodies))
        for shape_id, shape in enumerate(self.shapes.values()):
            has_shape = self.shape_ids[bodies] == shape_id
            shape_directions = body_directions[has_shape]
            if spheres is None:
                extents[has_shape] = shape.support(shape_directions)
            else:
                sphere_rows = shape.spheres_m[spheres[has_shape]]
                centres = sphere_rows[:, :3]
                radii = sphere_rows[:, 3]
                # A sphere extends by its radius from its own centre.
                centre_extents = np.sum(centres * shape_directions, axis=1)
                extents[has_shape] = centre_extents + radii
        return extents * self.scales[bodies]

    def wall_loads(self, about_m: ArrayLike = (0.0, 0.0, 0.0)) -> dict[str, WallLoad]:
        """Compute the present force and torque of the bodies on each wall.

        This call evaluates the wall contacts once more, so that the time steps need not
        record the loads.

        Parameters
        ----------
        about_m : array_like (3,)
            Point about which the torque is taken [m], such as one on the axis of a
            drum.

        Returns
        -------
        dict of str to WallLoad
            ``force_n`` (3,) [N] and ``torque_n_m`` (3,) [N m] by the name of the wall.

        Raises
        ------
        ValueError
            If `about_m` does not consist of three finite numbers.

        Notes
        -----
        Rolling resistance that acts on each body alone has no reaction on the wall, so
        it does not contribute to the torque.
        """
        point = check_vector("about_m", about_m)
        names = self.wall_set.names
        # A row for each wall: force, and torque about the origin of the world. The
        # kernel adds to these.
        loads = np.zeros((len(names), 6))
        # The kernel changes its arguments, so it gets copies. With a time step of 0 the
        # springs stay as they are.
        bodies, flat, curved, meshed, clumps = deepcopy(
            (self.bodies, self.flat, self.curved, self.meshed, self.clumps)
        )
        # The features of the meshes are not copied, because the kernel only overwrites
        # their working memory. `flat`, `curved` and `meshed` are the contacts with
        # planes, curved walls and meshes.
        add_wall_loads(
            bodies,
            flat,
            curved,
            meshed,
            clumps,
            self.walls._replace(loads=loads),
            self.meshes,
            self.counts.copy(),
            self.physics._replace(dt=0.0),
            self._tiles[0].copy(),
            self._scratches[0].copy(),
            len(self.grid.cell),
        )
        load_of_wall = {}
        for name, load in zip(names, loads, strict=True):
            force = load[:3].copy()
            # Move the torque from the origin to the point.
            torque = load[3:] - np.cross(point, force)
            load_of_wall[name] = WallLoad(force, torque)
        return load_of_wall

    def curved_contacts(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """List the contacts with cones, tubes and rings.

        Returns
        -------
        body : ndarray (M,)
            Index of the body.
        wall : ndarray (M,)
            Number of the wall. Cones and tubes are numbered first, then rings.
        normal : ndarray (M, 3)
            Unit vector into the wall.
        azimuth : ndarray (M,)
            Azimuth about the wall's axis [rad].
        """
        n_contacts = self.counts[state.N_CURVED]
        contact_rows = state.contact_rows(self.curved.data, n_contacts)
        # The first three rows of a contact are its normal.
        normal = contact_rows[:, :3].copy()
        # The engine may have renumbered the bodies. `_user_numbers` turns its indices
        # into those that `add` returned.
        body = self._user_numbers[self.curved.body[:n_contacts]]
        wall = self.curved.wall[:n_contacts].copy()
        # The azimuths of spheres follow from their centres: for clumps, relative to the
        # body as the contact stores them, and for single spheres, zero. The engine
        # keeps the azimuths of other smooth bodies. The constants of the rows count
        # numbers, of which a row has LANES.
        if self._has_clumps:
            column = clump_tile.CENTRE // state.LANES
            centres = contact_rows[:, column : column + 3]
            azimuth = self._compute_sphere_azimuths(body, wall, centres)
        elif self.physics.parts == state.SPHERES:
            centres = np.zeros((n_contacts, 3))
            azimuth = self._compute_sphere_azimuths(body, wall, centres)
        else:
            azimuth = contact_rows[:, state.AZIMUTH // state.LANES].copy()
        return body, wall, normal, azimuth

    def _compute_sphere_azimuths(
        self, bodies: np.ndarray, walls: np.ndarray, centres: np.ndarray
    ) -> np.ndarray:
        """Compute the azimuths of spheres about the axes of curved walls.

        Parameters
        ----------
        bodies, walls : ndarray (M,)
            Index of each sphere's body, and number of the wall as in `curved_contacts`.
        centres : ndarray (M, 3)
            Centres of the spheres in the frames of their bodies [m].

        Returns
        -------
        ndarray (M,)
            The azimuths [rad].
        """
        # From the frames of the bodies to the world
        rotations = rotation_matrices(self.quaternions[bodies])
        offsets = np.einsum("nij,nj->ni", rotations, centres)
        world_centres = self.positions[bodies] + offsets
        # From the world to the frames of the walls, by the inverse rotations
        frames = self.walls.frames[walls]
        origins = frames[:, :3]
        wall_rotations = frames[:, 3:].reshape(-1, 3, 3)
        x, y, _z = np.einsum("nji,nj->ni", wall_rotations, world_centres - origins).T
        return np.arctan2(y, x)

    def mesh_contacts(
        self,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """List the contacts with meshes.

        Meshes are numbered in the order of the walls. Features are numbered mesh by
        mesh: first the triangles, then the edges and vertices that can be touched.

        Returns
        -------
        body, mesh, feature : ndarray (M,)
            Index of the body, number of the mesh and of its feature.
        normal : ndarray (M, 3)
            Unit vector into the wall.
        overlap : ndarray (M,)
            Overlap in the last step [m]. It is negative for a contact that was found
            before the surfaces touch.
        """
        n_contacts = self.counts[state.N_MESHED]
        contact_rows = state.contact_rows(self.meshed.data, n_contacts)
        # The engine may have renumbered the bodies. `_user_numbers` turns its indices
        # into those that `add` returned.
        body = self._user_numbers[self.meshed.body[:n_contacts]]
        mesh = self.meshed.wall[:n_contacts].copy()
        feature = self.meshed.feature[:n_contacts].copy()
        # The first three rows of a contact are its normal.
        normal = contact_rows[:, :3].copy()
        # Contacts with meshes keep their gap. The constant GAP counts numbers, of which
        # a row has LANES.
        gap = contact_rows[:, state.GAP // state.LANES]
        return body, mesh, feature, normal, -gap


def _compute_tangent_offsets(
    walls: state.Walls,
    wall_numbers: np.ndarray,
    normals: np.ndarray,
    azimuths: np.ndarray,
) -> np.ndarray:
    """Compute the offsets c of the tangent planes n.x = c at contacts of curved walls.

    Curved walls are cones, tubes and rings. A ring is a torus about the rounded end of
    a wall, with the edge radius around its central circle. The normals n point into the
    walls.

    Parameters
    ----------
    walls : Walls
        The arrays of the walls.
    wall_numbers : ndarray (M,)
        Number of the wall at each contact. Cones and tubes are numbered first, then
        rings.
    normals : ndarray (M, 3)
        Unit vectors n into the walls.
    azimuths : ndarray (M,)
        Azimuths about the walls' axes [rad].

    Returns
    -------
    ndarray (M,)
        The offsets [m].
    """
    # A row of `Walls.frames` is the origin (3) and the rotation (9) of the frame. Begin
    # with the offset of the origin along n. The offset within the frame is added below.
    frames = walls.frames[wall_numbers]
    origins = frames[:, :3]
    offsets = np.sum(normals * origins, axis=1)

    # Every tangent plane of a cone has the same offset, that of the cone's line in its
    # half plane.
    n_cones = len(walls.cones)
    is_cone = wall_numbers < n_cones
    offsets[is_cone] += walls.cones[wall_numbers[is_cone], state.CONE_OFFSET]

    # Find the point of a ring's central circle that is nearest to each contact, in the
    # frame of the ring.
    is_ring = ~is_cone
    rings = walls.rings[wall_numbers[is_ring] - n_cones]
    x = rings[:, state.RING_RADIUS] * np.cos(azimuths[is_ring])
    y = rings[:, state.RING_RADIUS] * np.sin(azimuths[is_ring])
    z = rings[:, state.RING_HEIGHT]

    # Seen along n, which points into the ring, the tangent plane lies one edge radius
    # before this point.
    rotations = frames[is_ring, 3:].reshape(-1, 3, 3)
    points = np.einsum("nij,nj->ni", rotations, np.column_stack([x, y, z]))
    distances = np.sum(normals[is_ring] * points, axis=1)
    offsets[is_ring] += distances - rings[:, state.RING_EDGE_RADIUS]
    return offsets
