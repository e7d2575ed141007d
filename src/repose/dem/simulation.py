"""Run a simulation: add bodies, advance by time steps, save and load."""

import os
import time
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from . import contact_lists, time_steps
from .body_rows import Body, write_body
from .checks import (
    check_direction,
    check_not_negative,
    check_number,
    check_positive,
    check_vector,
    check_whole_number,
    look_up_choice,
)
from .io import checkpoint as checkpoints
from .io.progress import show_progress
from .kernels import parallel, state
from .kernels.atomics import BARRIER_SIZE
from .kernels.engine import advance
from .kernels.order import reorder
from .laws import ROLLING_LAWS
from .observables import Observables
from .walls import Motion

CHUNK_S = 0.2  # wall time that the steps of one chunk of `run` should take
FIRST_CHUNK_STEPS = 20
SHORTEST_WALL_TIME_S = 1e-6  # avoids a division by 0 if a chunk takes no time
RecordFunction = Callable[["Simulation"], Any]


class Simulation(Observables):
    """Bodies among walls: either all smooth and convex or all clumps of spheres.

    Parameters
    ----------
    shapes : dict of str to Shape, or dict of str to Clump
        The shapes by name. A sphere among clumps is a clump of one sphere.
    materials : dict of str to Material
        The materials by name.
    contacts : dict of (str, str) to Contact
        The contact for every pair of materials that can meet, in either order.
    time_step_s : float
        Time step [s], above 0, at most `longest_time_step()`.
    capacity : int
        Largest number of bodies.
    lower, upper : array_like (3,)
        Corners of a box in which most bodies stay [m]. It affects only the search for
        neighbours.
    walls : dict of str to Plane, Cone, RingEdge or Mesh, optional
        The walls by name.
    gravity_m_s2 : array_like (3,)
        Acceleration of gravity [m/s2].
    tension : {"keep", "release", "cut"}
        How a contact ends. "keep" lets the damped normal force pull at the end of an
        impact, so that a body leaves with the specified restitution. "release" ends the
        contact when the force vanishes, and adjusts the damping so that the restitution
        is still the specified one. "cut" also ends the contact then, but has the
        damping of "keep", so that bodies leave faster than specified.
    friction_limit : {"elastic", "total"}, optional
        Which normal force limits friction and rolling resistance: its elastic part, or
        the magnitude of the total force, including damping. The default is "elastic" if
        the contact may pull and "total" if it may not. Only these combinations obey
        Coulomb's law, according to which a sliding impact has the tangential impulse
        mu (1 + e) m V. The others are for comparisons with programs that use them.
    contact_law, rolling_law : str
        Names of force laws, see `repose.dem.laws`. "budget" resists the angular
        velocity of each body in space, including spin about the normal, by mu_r F_n R,
        where R is the distance of the contact from the centre of mass. It does not
        conserve angular momentum, and `rolling_frame_rad_s` must be set if walls
        rotate. "epsd" resists the rotation of one body relative to the other, and
        conserves angular momentum.
    largest_scale : float
        The largest scale that `add` will be given.
    threads : int
        Number of threads for a simulation of 4096 smooth bodies or more. The result
        does not depend on it. Smaller simulations and those of clumps use one thread.
    exit_height_m : float
        A body that falls through this height gets an exit time.
    curved_walls_above_m : float
        All cones, cylinders and ring edges lie above this height. Once a body has been
        entirely below it, its contacts with them are no longer searched for.
    floor_height_m : float
        A body that falls below this height is removed.

    Raises
    ------
    ValueError
        If an argument is not allowed. The message names it, its value and what is
        allowed.
    """

    def set_motion(self, wall: str, motion: Motion) -> None:
        """Change the motion of a wall from now on.

        Parameters
        ----------
        wall : str
            Name of the wall.
        motion : Motion
            The new motion. The other walls keep their motions.

        Raises
        ------
        ValueError
            If no wall has this name, or if the motion is not a `Motion`.
        """
        if not isinstance(motion, Motion):
            raise ValueError(f"motion is {motion!r}; expected a Motion")
        self.wall_set = self.wall_set.with_motion(wall, motion)
        wall_number = self.wall_set.names.index(wall)
        # The arrays are made from `wall_set`, so this comes last.
        self.walls = self._make_walls(old_walls=self.walls, changed_wall=wall_number)

        # Make the next step check all bodies against the walls. The check of a body is
        # due when its displacement reaches `wall_check`. Displacements are never below
        # 0, so -1 makes the check due at once. `wall_margin` is how far the bodies of a
        # tile may move until one of them is due.
        present = np.flatnonzero(self.bodies.presence[: self.n_bodies] == state.PRESENT)
        self.bodies.wall_check[present] = -1.0
        self.bodies.wall_margin[:] = 0.0

    def _warn_of_turning_walls(self) -> None:
        """Warn if a wall rotates while the frame of the rolling resistance does not.

        Laws that resist the rotation of each body in space (`of_each_body`) then brake
        bodies that rotate together with the wall. Other laws are not affected.
        """
        # A row of the motion is velocity, angular velocity and pivot, three numbers
        # each.
        angular_velocities = self.walls.motion[:, 3:6]
        if not angular_velocities.any():
            return
        law_name = self.rolling_law.name
        if law_name not in ROLLING_LAWS:
            return
        if not ROLLING_LAWS.entry(law_name).of_each_body:
            return
        if self.physics.rolling_frame.any():
            return
        if all(pair.rolling_friction == 0.0 for pair in self.contact_pairs.values()):
            return
        # With this level, Python shows the line that called `run_steps`.
        warnings.warn(
            f"a wall turns, and rolling_law {law_name!r} resists each body's rotation "
            "in space: angles and torques are wrong. Set rolling_frame_rad_s to the "
            "wall's angular velocity, or take rolling_law='epsd'",
            stacklevel=3,
        )

    @property
    def rolling_frame_rad_s(self) -> np.ndarray:
        """Angular velocity of the frame for rolling resistance [rad/s], a view (3,).

        It is zero unless it is set.
        """
        return self.physics.rolling_frame

    def longest_time_step(
        self, speed_m_s: float = time_steps.FASTEST_IMPACT_M_S
    ) -> float:
        """Compute the longest time step for bodies of scale 1.

        For bodies of another scale, it is proportional to the scale.

        It is an eighth of the shortest head-on impact of two bodies, or less if a body
        that is pressed from both sides would not be stable; see
        `repose.dem.time_steps`.

        Parameters
        ----------
        speed_m_s : float
            Relative speed of the fastest impact [m/s].

        Returns
        -------
        float
            The longest time step [s], over all shapes and walls.

        Notes
        -----
        The duration of an impact depends on the contact law. For Hertz's law it is
        2.868 (m*^2 / (R* E*^2 v))^0.2 (Johnson 1985, Eq. 11.24).
        """
        speed = check_positive("speed_m_s", speed_m_s)
        return time_steps.compute_longest(self.scene, speed).time_step_s

    def add(
        self,
        shape: str,
        position_m: ArrayLike,
        quaternion: ArrayLike = (1.0, 0.0, 0.0, 0.0),
        velocity_m_s: ArrayLike = (0.0, 0.0, 0.0),
        angular_velocity_rad_s: ArrayLike = (0.0, 0.0, 0.0),
        scale: float = 1.0,
    ) -> int:
        """Add one body. Whether there is room for it is not checked.

        Parameters
        ----------
        shape : str
            Name of its shape.
        position_m : array_like (3,)
            Its centre [m].
        quaternion : array_like (4,)
            Its orientation (w, x, y, z), body to world; any length but 0.
        velocity_m_s, angular_velocity_rad_s : array_like (3,)
            Its velocities in the world frame [m/s, rad/s].
        scale : float
            Factor by which the lengths of the shape are multiplied, at most
            `largest_scale`. The time step sets a lower limit.

        Returns
        -------
        int
            The index of the body.

        Raises
        ------
        ValueError
            If an argument is not allowed, or if the capacity is used up. The message
            names the argument.
        """
        index = self.n_bodies
        if index >= self.capacity:
            raise ValueError(
                f"capacity is {self.capacity}; body {index + 1} does not fit"
            )
        body_shape = look_up_choice("shape", shape, self.shapes)
        body = Body(
            shape=body_shape,
            scale=self._check_scale(shape, scale),
            position=check_vector("position_m", position_m),
            quaternion=check_direction("quaternion", quaternion, 4),
            velocity=check_vector("velocity_m_s", velocity_m_s),
            angular_velocity=check_vector(
                "angular_velocity_rad_s", angular_velocity_rad_s
            ),
        )
        # Write all that the kernels need to know about the body.
        write_body(self.bodies, index, body, self.physics.parts, self._body_tiles[0])
        self._shape_ids[index] = list(self.shapes).index(shape)
        self._scales[index] = scale
        self.bodies.material[index] = self._material_numbers.body_materials[
            body_shape.material
        ]
        self.bodies.presence[index] = state.PRESENT
        self.counts[state.N_BODIES] = index + 1

        # The body may rotate, so its tile, a group of LANES bodies that are computed
        # together, is no longer at rest.
        self.bodies.resting[index // state.LANES] = 0
        # Make the next step check this body against the walls. The check is due when
        # the displacement of the body, which is never below 0, reaches -1.
        self.bodies.wall_check[index] = -1.0
        self.bodies.wall_margin[index // state.LANES] = 0.0
        # Make the next step search for its neighbours, too, by adding it to the list of
        # bodies that have moved.
        self.grid.moved[index] = 1
        self.grid.moved_list[self.counts[state.N_MOVED]] = index
        self.counts[state.N_MOVED] += 1
        return index

    def _check_scale(self, shape: str, scale: float) -> float:
        """Return the scale of a body, or raise ValueError if it is out of range."""
        smallest = self._smallest_scales[shape]
        largest = self.largest_scale
        check_number(
            "scale",
            scale,
            allowed=(
                f"at least {smallest:.3g}, or time_step_s is too long, "
                f"at most largest_scale, {largest:g}"
            ),
            accepts=lambda value: smallest <= value <= largest,
        )
        return scale

    def glue(self, body: int) -> None:
        """Fix a body in its place, so that forces no longer move or rotate it.

        The body stops. Its inverse mass and inverse moments of inertia become 0. Sums
        over the bodies leave out its mass, as if the body had left the simulation.
        Fixed bodies must not overlap each other.

        Parameters
        ----------
        body : int
            Its index.

        Raises
        ------
        ValueError
            If there is no such body.
        """
        check_number(
            "body",
            body,
            allowed=f"an index below {self.n_bodies}",
            accepts=lambda index: 0 <= index < self.n_bodies and index == int(index),
        )
        # A large simulation renumbers its bodies from time to time. `_engine_numbers`
        # holds the present index of each body in the engine.
        engine_number = self._engine_numbers[body] if self._runs_in_shares else body
        row = self.bodies.rows[engine_number]
        row[state.VELOCITY : state.VELOCITY + 3] = 0.0
        row[state.ANGULAR_VELOCITY : state.ANGULAR_VELOCITY + 3] = 0.0
        row[state.INVERSE_MASS] = 0.0
        # The other numbers are in a tile of LANES bodies, in which the numbers of one
        # body are LANES places apart (`kernels.rows`). The slice is a view of them. The
        # constants below count the places of the tile.
        tile = self.bodies.motion[engine_number // state.LANES]
        body_numbers = tile[engine_number % state.LANES :: state.LANES]
        for offset in (state.INVERSE_MOMENTS, state.ANGULAR_MOMENTUM):
            first = offset // state.LANES
            body_numbers[first : first + 3] = 0.0

    def run_steps(self, steps: int) -> None:
        """Advance by a number of time steps.

        Parameters
        ----------
        steps : int
            Number of steps, 0 or more.

        Raises
        ------
        ValueError
            If `steps` is not a whole number of 0 or more.
        RuntimeError
            If bodies overlap so much that a list of contacts overflows within one step.
        """
        steps_left = check_whole_number("steps", steps, 0)
        if steps_left > 0:
            self._warn_of_turning_walls()
        while steps_left > 0:
            # `_advance` returns the number of steps made, at most `steps_left`.
            steps_left -= self._advance(steps_left)
            # A list that overflows within one step sets this flag. Contacts are then
            # missing.
            if self.counts[state.FULL]:
                raise RuntimeError(
                    "a contact list overflowed within one step; bodies overlap too much"
                )
            # The engine stops before a step if a list of contacts is nearly full, so
            # that it can be lengthened.
            if steps_left > 0:
                self._grow_lists()

    def _advance(self, steps: int) -> int:
        """Advance by at most `steps` time steps.

        The call ends early when a list of contacts fills up, or when the bodies of a
        large simulation need new numbers.

        Returns
        -------
        int
            Number of steps made.
        """
        if self._runs_in_shares:
            return self._advance_in_shares(steps)
        return advance(
            self.bodies,
            self.pairs,
            self.flat,
            self.curved,
            self.meshed,
            self.clumps,
            self.grid,
            self.walls,
            self.meshes,
            self.counts,
            self.physics,
            self._tiles[0],
            self._body_tiles[0],
            self._scratches[0],
            steps,
        )

    def _advance_in_shares(self, steps: int) -> int:
        """Advance a large simulation, whose threads share the work.

        The work of a step is divided into a fixed number of shares, so that the result
        does not depend on the number of threads. The argument and the result are those
        of `_advance`.
        """
        # Renumber the bodies every REORDER_EVERY steps, between two calls of the
        # engine. Therefore this call ends at the next multiple of REORDER_EVERY.
        steps_since_reorder = self.steps % parallel.REORDER_EVERY
        if steps_since_reorder == 0:
            self._renumber_bodies()
        steps = min(steps, parallel.REORDER_EVERY - steps_since_reorder)

        # Counters and lists through which the threads agree on the next piece of work
        shared = state.Shared(
            counters=np.zeros(BARRIER_SIZE, np.int64),
            flags=np.zeros(1, np.int64),
            # Two arrays with these names, with a number for each share
            **state.equal_arrays("begins n_found", parallel.SHARES, np.int64),
            touching=np.zeros(len(self.pairs.near_limit), np.int64),
        )
        # Arrays of the simulation, which all threads use, in the order that
        # `run_threads` expects. `flat`, `curved` and `meshed` are the contacts with
        # planes, curved walls and meshes.
        simulation_arrays = (
            self.bodies,
            self.pairs,
            self.flat,
            self.curved,
            self.meshed,
            self.grid,
            self.walls,
            self.meshes,
            self.counts,
            self.physics,
        )
        # Working memory: each array has a row for each thread.
        scratch = (self._tiles, self._body_tiles, self._scratches)
        return parallel.run_threads(simulation_arrays, scratch, shared, steps)

    def _renumber_bodies(self) -> None:
        """Renumber the bodies in spatial order, so that neighbours lie close in memory.

        Users still see the numbers that `add` returned.
        """
        n_bodies = self.n_bodies
        old_numbers = reorder(
            self.bodies,
            self.grid,
            self.pairs,
            self.flat,
            self.curved,
            self.meshed,
            self.counts,
        )
        # `old_numbers` maps the new engine number of each body to its old one.
        self._user_numbers[:n_bodies] = self._user_numbers[:n_bodies][old_numbers]
        self._engine_numbers[self._user_numbers[:n_bodies]] = np.arange(n_bodies)

    def _grow_lists(self) -> None:
        """Replace lists of contacts that are filling up by lists of twice the length.

        `flat`, `curved` and `meshed` are the lists of contacts with planes, curved
        walls and meshes. The arrays of a list are replaced together, in one assignment.
        Therefore an interrupt, such as Ctrl+C, never leaves a list whose arrays differ
        in length.
        """
        self.pairs = contact_lists.grow_pairs(
            self.pairs,
            self.counts,
            self.capacity,
            self._most_spheres,
            self._n_history_rows,
        )
        self.flat = contact_lists.grow_wall_contacts(
            self.flat, self.counts[state.N_PLANE], self.capacity
        )
        self.curved = contact_lists.grow_wall_contacts(
            self.curved, self.counts[state.N_CURVED], self.capacity
        )
        meshed = contact_lists.grow_wall_contacts(
            self.meshed, self.counts[state.N_MESHED], self.capacity
        )
        if self._has_clumps:
            # `mesh_sphere` must be at least as long as the list of contacts with
            # meshes, so it is lengthened first.
            n_added = len(meshed.body) - len(self.clumps.mesh_sphere)
            mesh_sphere = np.pad(self.clumps.mesh_sphere, (0, n_added))
            self.clumps = self.clumps._replace(mesh_sphere=mesh_sphere)
        self.meshed = meshed

    def run(
        self,
        seconds: float,
        progress: Callable[[float], Any] | bool | None = None,
        *,
        record: RecordFunction | Sequence[RecordFunction] | None = None,
        record_every_s: float | None = None,
        checkpoint: str | os.PathLike | None = None,
        every_s: float = 600.0,
    ) -> None:
        """Advance by simulated time, to the nearest time step.

        Ctrl-C ends the run between two steps. Only the argument `seconds` affects the
        result.

        Parameters
        ----------
        seconds : float
            Simulated time [s].
        progress : callable or False, optional
            Function that is called with the simulated time at intervals. False shows
            nothing. By default, a progress bar is shown if stderr is a terminal, and
            otherwise a line per minute is written.
        record : callable or sequence of callables, optional
            Functions that are called with the simulation at time 0 and then every
            `record_every_s`, such as a `Recorder` or a `VtkSeries`.
        record_every_s : float, optional
            Simulated time between two records [s].
        checkpoint : path, optional
            File that `save` writes at intervals, at the end, and on Ctrl-C.
        every_s : float
            Wall time between two checkpoints [s].

        Raises
        ------
        ValueError
            If an argument is not allowed. The message names it.
        """
        time_step = self.time_step_s
        last_step = self.steps + round(
            check_not_negative("seconds", seconds) / time_step
        )
        recorders = _list_recorders(record)
        steps_per_record = None  # without recorders
        if recorders:
            steps_per_record = _count_steps_per_record(record_every_s, time_step)
        check_positive("every_s", every_s)

        # The steps run in chunks. A chunk ends at the next record at the latest.
        chunk_steps = FIRST_CHUNK_STEPS
        last_save_s = time.monotonic()
        end_s = last_step * time_step
        with show_progress(self.time_s, end_s, time_step, progress) as report:
            try:
                if self.steps == 0:
                    self._record(recorders)
                while self.steps < last_step:
                    steps = min(last_step - self.steps, chunk_steps)
                    if steps_per_record is not None:
                        steps_to_record = (
                            steps_per_record - self.steps % steps_per_record
                        )
                        steps = min(steps, steps_to_record)
                    chunk_steps = self._run_chunk(steps)
                    if (
                        steps_per_record is not None
                        and self.steps % steps_per_record == 0
                    ):
                        self._record(recorders)
                    report(self.time_s)
                    is_due = time.monotonic() - last_save_s >= every_s
                    if checkpoint is not None and is_due:
                        self.save(checkpoint)
                        last_save_s = time.monotonic()
            except KeyboardInterrupt:
                if checkpoint is not None:
                    self.save(checkpoint)
                raise
        if checkpoint is not None:
            self.save(checkpoint)

    def _run_chunk(self, steps: int) -> int:
        """Run a chunk of steps, and return the number of steps of the next chunk."""
        start = time.perf_counter()
        self.run_steps(steps)
        return _choose_next_chunk(steps, time.perf_counter() - start)

    def _record(self, recorders: list[RecordFunction]) -> None:
        """Call each recorder with the simulation."""
        for recorder in recorders:
            recorder(self)

    def save(self, path: str | os.PathLike) -> None:
        """Write the whole state to a file, from which `load` continues.

        The file is an .npz archive without pickled objects. It replaces an old file
        only when it is complete.

        Parameters
        ----------
        path : path
            The file.
        """
        checkpoints.save(self, path)

    @classmethod
    def load(cls, path: str | os.PathLike) -> "Simulation":
        """Read the simulation that `save` wrote.

        It continues exactly, to the last bit, as if it had never stopped.

        Parameters
        ----------
        path : path
            The file.

        Returns
        -------
        Simulation
            The simulation in the state in which it was saved.

        Raises
        ------
        repose.dem.errors.InputError
            If the file is missing, damaged, of another format, or written by another
            version of the engine. This error is a ValueError and names the file.
        """
        return checkpoints.load(cls, path)


def _list_recorders(record: Any) -> list[RecordFunction]:
    """Return the argument `record` of `Simulation.run` as a list of functions.

    Raises ValueError if it contains anything but functions.
    """
    if record is None:
        return []
    recorders = list(record) if isinstance(record, list | tuple) else [record]
    if not all(callable(recorder) for recorder in recorders):
        raise ValueError(
            f"record is {record!r}; "
            "expected a function of the simulation, or a list of them"
        )
    return recorders


def _count_steps_per_record(record_every_s: float | None, time_step: float) -> int:
    """Compute the number of steps between two records, which is at least one.

    Raises ValueError without a time.
    """
    if record_every_s is None:
        raise ValueError(
            "record_every_s is None; "
            "expected above 0, since there is something to record"
        )
    interval_s = check_positive("record_every_s", record_every_s)
    return max(1, round(interval_s / time_step))


def _choose_next_chunk(steps: int, wall_time_s: float) -> int:
    """Choose the number of steps that take about `CHUNK_S`.

    The number changes by a factor of ten at most, since the first chunk may include the
    time to compile.

    Parameters
    ----------
    steps : int
        Number of steps in the previous chunk.
    wall_time_s : float
        Wall time that these steps took [s].
    """
    estimate = steps * CHUNK_S / max(wall_time_s, SHORTEST_WALL_TIME_S)
    limited = min(max(estimate, 0.1 * steps), 10.0 * steps)
    return max(1, round(limited))
