"""The results that a simulation reports: bodies, contacts and loads on walls."""

from copy import deepcopy
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .checks import vector
from .kernels import clump_tile as ct
from .kernels import state as st
from .kernels.engine import add_wall_loads
from .rotations import rotation_matrices
from .world import World


class WallLoad(NamedTuple):
    """The load of the bodies on a wall.

    Attributes
    ----------
    force_n : ndarray (3,)
        Sum of their forces [N].
    torque_n_m : ndarray (3,)
        Torque of these forces about a point, and of the rolling couples of a law that acts between two bodies [N m].
    """

    force_n: np.ndarray
    torque_n_m: np.ndarray


class Observables(World):
    """The results of a `Simulation`."""

    def __repr__(self) -> str:
        laws = f"{self.contact_law.name}, {self.rolling_law.name}"
        return f"<Simulation: {self.n_bodies} bodies, {len(self.wall_set.names)} walls, {laws}, {self.time_s:g} s>"

    @property
    def n_bodies(self) -> int:
        """Number of bodies added so far."""
        return int(self.counts[st.N_BODIES])

    @property
    def steps(self) -> int:
        """Number of time steps made."""
        return int(self.counts[st.STEPS])

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
        """Centres of the bodies added so far (N, 3) [m]; a view in simulations of fewer than 4096 bodies."""
        return self._seen(self.bodies.rows)[:, st.POSITION : st.POSITION + 3]

    @property
    def quaternions(self) -> np.ndarray:
        """Orientations (w, x, y, z), body to world, a copy (N, 4)."""
        return self._seen(
            st.lanes_of(self.bodies.motion, st.QUATERNION, 4, self.n_bodies)
        )

    @property
    def velocities(self) -> np.ndarray:
        """Velocities of the centres (N, 3) [m/s]; a view as `positions` is."""
        return self._seen(self.bodies.rows)[:, st.VELOCITY : st.VELOCITY + 3]

    @property
    def angular_velocities(self) -> np.ndarray:
        """Angular velocities in the world frame (N, 3) [rad/s]; a view as `positions` is."""
        return self._seen(self.bodies.rows)[
            :, st.ANGULAR_VELOCITY : st.ANGULAR_VELOCITY + 3
        ]

    @property
    def angular_momenta(self) -> np.ndarray:
        """Angular momenta about the centres in the world frame, a copy (N, 3) [kg m2/s]."""
        return self._seen(
            st.lanes_of(self.bodies.motion, st.ANGULAR_MOMENTUM, 3, self.n_bodies)
        )

    @property
    def shape_ids(self) -> np.ndarray:
        """Shape of each body, as its place among the names of `shapes`, a view (N,)."""
        return self._shape_ids[: self.n_bodies]

    @property
    def scales(self) -> np.ndarray:
        """Scale of each body, a view (N,)."""
        return self._scales[: self.n_bodies]

    @property
    def present(self) -> np.ndarray:
        """Whether each body is still there (N,)."""
        return self._seen(self.bodies.presence) == st.PRESENT

    @property
    def exit_times_s(self) -> np.ndarray:
        """Time at which each body fell through the exit height (N,) [s]; nan where it did not."""
        return self._seen(self.bodies.exit_time)

    def _seen(self, values: np.ndarray) -> np.ndarray:
        """Order values of the bodies as they were added: a view where the engine has the same order."""
        return (
            values[self._inner[: self.n_bodies]]
            if self._shared
            else values[: self.n_bodies]
        )

    @property
    def masses_kg(self) -> np.ndarray:
        """Mass of each body, a copy (N,) [kg]; 0 where it is gone."""
        inverse = self._seen(self.bodies.rows)[:, st.INVERSE_MASS]
        return np.divide(1.0, inverse, out=np.zeros_like(inverse), where=inverse > 0.0)

    def kinetic_energies(self) -> np.ndarray:
        """Kinetic energy of each body, of translation and rotation.

        Returns
        -------
        ndarray (N,)
            The energies [J].
        """
        translation = 0.5 * self.masses_kg * np.sum(self.velocities**2, axis=1)
        rotation = 0.5 * np.sum(self.angular_momenta * self.angular_velocities, axis=1)
        return translation + rotation

    def contacts(self) -> np.ndarray:
        """Pairs of bodies that touch.

        Returns
        -------
        ndarray (M, 2)
            Indices of the two bodies, the smaller first, sorted by rows.
        """
        n = self.counts[st.N_PAIRS]
        pairs = self._outer[
            np.column_stack([self.pairs.first[:n], self.pairs.second[:n]])
        ]
        pairs.sort(axis=1)
        # of two clumps several spheres may touch
        return (
            np.unique(pairs, axis=0)
            if self._of_clumps
            else pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
        )

    def sphere_contacts(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Spheres of two clumps that touch; empty for smooth bodies.

        Returns
        -------
        bodies : ndarray (M, 2)
            Indices of the two bodies, the smaller first.
        spheres : ndarray (M, 2)
            Indices of their spheres.
        normals : ndarray (M, 3)
            Unit vectors from the first body to the second.
        """
        n = int(self.counts[st.N_PAIRS]) if self._of_clumps else 0
        bodies = np.column_stack([self.pairs.first[:n], self.pairs.second[:n]]).astype(
            np.int64
        )
        spheres = (
            self.pairs.spheres[:n].astype(np.int64) if n else np.zeros((0, 2), np.int64)
        )
        return bodies, spheres, st.contact_rows(self.pairs.data, n)[:, :3].copy()

    def overlaps(self) -> tuple[np.ndarray, np.ndarray]:
        """How deep bodies that touch overlap, along the normals of the last step.

        Returns
        -------
        bodies : ndarray (M, 2)
            Indices of the two bodies, for each contact of two clumps once.
        overlaps : ndarray (M,)
            The overlaps [m].
        """
        n = int(self.counts[st.N_PAIRS])
        first, second = (
            self._outer[self.pairs.first[:n]],
            self._outer[self.pairs.second[:n]],
        )
        normals = st.contact_rows(self.pairs.data, n)[:, :3]
        spheres = self.pairs.spheres[:n].T if self._of_clumps else (None, None)
        reach = self._reach(first, normals, spheres[0]) + self._reach(
            second, -normals, spheres[1]
        )
        apart = np.sum(
            (self.positions[second] - self.positions[first]) * normals, axis=1
        )
        return np.column_stack([first, second]), reach - apart

    def wall_overlaps(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """How deep bodies overlap walls.

        Returns
        -------
        bodies : ndarray (M,)
            Index of the body, for each contact of a clump's sphere once.
        walls : ndarray (M,)
            Number of the wall in `wall_set.names`.
        overlaps : ndarray (M,)
            The overlaps [m], for meshes those of the last step.

        Notes
        -----
        A wall is at a contact what its tangent plane is, n.x = c: the overlap of a body with support h and centre x is
        h(n) + n.x - c.
        """
        n_planes, n_curved = (
            len(self.walls.planes),
            len(self.walls.cones) + len(self.walls.rings),
        )
        n = int(self.counts[st.N_PLANE])
        on_plane, plane = (
            self._outer[self.flat.body[:n]],
            self.flat.wall[:n].astype(np.int64),
        )
        normals = self.walls.planes[plane, 3:6]
        offsets = np.sum(normals * self.walls.planes[plane, :3], axis=1)
        flat = self._beyond(on_plane, normals, offsets, self.flat.feature[:n])
        on_curved, curved_wall, normals, azimuths = self.curved_contacts()
        curved_wall = curved_wall.astype(np.int64)
        offsets = _tangent_planes(self.walls, curved_wall, normals, azimuths)
        curved = self._beyond(
            on_curved, normals, offsets, self.curved.feature[: len(on_curved)]
        )
        on_mesh, mesh, _, _, meshed = self.mesh_contacts()
        bodies = np.concatenate([on_plane, on_curved, on_mesh]).astype(np.int64)
        walls = np.concatenate(
            [plane, n_planes + curved_wall, n_planes + n_curved + mesh]
        ).astype(np.int64)
        return bodies, walls, np.concatenate([flat, curved, meshed])

    def _beyond(
        self,
        bodies: np.ndarray,
        normals: np.ndarray,
        offsets: np.ndarray,
        spheres: np.ndarray,
    ) -> np.ndarray:
        """Measure how far bodies, or one sphere of each clump, reach (M,) beyond planes with these normals."""
        reach = self._reach(bodies, normals, spheres if self._of_clumps else None)
        return reach + np.sum(normals * self.positions[bodies], axis=1) - offsets

    def _reach(
        self, body: np.ndarray, direction: np.ndarray, sphere: np.ndarray | None
    ) -> np.ndarray:
        """Measure the extents (M,) of bodies, or of one sphere of each, along directions (M, 3) in space."""
        local = np.einsum(
            "nji,nj->ni", rotation_matrices(self.quaternions[body]), direction
        )
        reach = np.zeros(len(body))
        for number, shape in enumerate(self.shapes.values()):
            these = self.shape_ids[body] == number
            if sphere is None:
                reach[these] = shape.support(local[these])
            else:
                rows = shape.spheres_m[sphere[these]]
                reach[these] = np.sum(rows[:, :3] * local[these], axis=1) + rows[:, 3]
        return reach * self.scales[body]

    def wall_loads(self, about_m: ArrayLike = (0.0, 0.0, 0.0)) -> dict[str, WallLoad]:
        """Force and torque of the bodies on each wall, now.

        They are found when they are asked for, by one more evaluation of all wall contacts; a step does not take
        longer for it.

        Parameters
        ----------
        about_m : array_like (3,)
            Point about which the torque is taken, such as one on the axis of a drum [m].

        Returns
        -------
        dict of str to WallLoad
            ``force_n`` (3,) [N] and ``torque_n_m`` (3,) [N m] by the name of the wall.

        Raises
        ------
        ValueError
            Where `about_m` is not three finite numbers.

        Notes
        -----
        The torque is that of the contact forces. Rolling resistance acts on bodies alone and is no part of it.
        """
        about = vector("about_m", about_m)
        names = self.wall_set.names
        walls = self.walls._replace(loads=np.zeros((len(names), 6)))
        # the forces of the present state, found on copies with springs that stay
        copies = deepcopy(
            (self.bodies, self.flat, self.curved, self.meshed, self.clumps)
        )
        scratch = self._tiles[0].copy(), self._scratches[0].copy()
        physics = self.physics._replace(dt=0.0)
        add_wall_loads(
            *copies,
            walls,
            self.meshes,
            self.counts.copy(),
            physics,
            *scratch,
            len(self.grid.cell),
        )
        found = zip(names, walls.loads, strict=True)
        return {
            name: WallLoad(load[:3].copy(), load[3:] - np.cross(about, load[:3]))
            for name, load in found
        }

    def curved_contacts(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Contacts with cones, tubes and rings.

        Returns
        -------
        body : ndarray (M,)
            Index of the body.
        wall : ndarray (M,)
            Number of the wall: the cones and tubes first, then the rings.
        normal : ndarray (M, 3)
            Unit vector into the wall.
        azimuth : ndarray (M,)
            Azimuth about the wall's axis [rad].
        """
        n = self.counts[st.N_CURVED]
        rows = st.contact_rows(self.curved.data, n)
        body, wall = self._outer[self.curved.body[:n]], self.curved.wall[:n].copy()
        azimuth = rows[:, st.AZIMUTH // st.LANES].copy()
        if self._of_clumps:
            azimuth = self._sphere_azimuths(
                body, wall, rows[:, ct.CENTRE // st.LANES :][:, :3]
            )
        elif self.physics.parts == st.SPHERES:  # whose contacts need none
            azimuth = self._sphere_azimuths(body, wall, np.zeros((n, 3)))
        return body, wall, rows[:, :3].copy(), azimuth

    def _sphere_azimuths(
        self, body: np.ndarray, wall: np.ndarray, centres: np.ndarray
    ) -> np.ndarray:
        """Compute azimuths (M,) in the frames of curved walls for spheres with these centres (M, 3) in their bodies."""
        places = self.positions[body] + np.einsum(
            "nij,nj->ni", rotation_matrices(self.quaternions[body]), centres
        )
        frames = self.walls.frames[wall]
        local = np.einsum(
            "nji,nj->ni", frames[:, 3:].reshape(-1, 3, 3), places - frames[:, :3]
        )
        return np.arctan2(local[:, 1], local[:, 0])

    def mesh_contacts(
        self,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Contacts with meshes.

        Meshes and features are numbered in the order of the walls: of each mesh its triangles, then its edges and
        vertices that can be touched.

        Returns
        -------
        body, mesh, feature : ndarray (M,)
            Index of the body, number of the mesh and of its feature.
        normal : ndarray (M, 3)
            Unit vector into the wall.
        overlap : ndarray (M,)
            Overlap in the last step [m]; a contact is found before it bears a force.
        """
        n = self.counts[st.N_MESHED]
        rows = st.contact_rows(self.meshed.data, n)
        wall, feature = (
            getattr(self.meshed, name)[:n].copy() for name in ("wall", "feature")
        )
        return (
            self._outer[self.meshed.body[:n]],
            wall,
            feature,
            rows[:, :3].copy(),
            -rows[:, st.GAP // st.LANES],
        )


def _tangent_planes(
    walls: st.Walls, wall: np.ndarray, normals: np.ndarray, azimuths: np.ndarray
) -> np.ndarray:
    """Compute the offsets (M,) of the tangent planes of cones, tubes and rings where bodies touch them."""
    n_cones = len(walls.cones)
    frames = walls.frames[wall]
    offsets = np.sum(normals * frames[:, :3], axis=1)
    on_cone = wall < n_cones
    offsets[on_cone] += walls.cones[wall[on_cone], 2]
    rings, turn = walls.rings[wall[~on_cone] - n_cones], azimuths[~on_cone]
    cores = np.column_stack(
        [rings[:, 0] * np.cos(turn), rings[:, 0] * np.sin(turn), rings[:, 1]]
    )
    cores = np.einsum("nij,nj->ni", frames[~on_cone, 3:].reshape(-1, 3, 3), cores)
    offsets[~on_cone] += np.sum(normals[~on_cone] * cores, axis=1) - rings[:, 2]
    return offsets
