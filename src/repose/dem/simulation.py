"""A simulation as a Python object: bodies in, positions out, every argument checked."""

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
    chosen,
    direction,
    not_negative,
    number,
    positive,
    vector,
    whole_number,
)
from .io import checkpoint as checkpoints
from .io.progress import display
from .kernels import parallel
from .kernels import state as st
from .kernels.atomics import BARRIER_SIZE
from .kernels.engine import advance
from .kernels.order import reorder
from .laws import ROLLING_LAWS
from .observables import Observables
from .walls import Motion

TURNING = (
    "a wall turns, and rolling_law 'budget' resists each body's rotation in space: angles and torques are wrong. Set "
    "rolling_frame_rad_s to the wall's angular velocity, or take rolling_law='epsd'"
)
CHUNK_S = 0.2  # wall time of `run` between two reads of the clock
FIRST_CHUNK = 20  # steps


class Simulation(Observables):
    """Bodies of given shapes among walls, all of them smooth and convex or all of them clumps of spheres.

    Parameters
    ----------
    shapes : dict of str to Shape, or dict of str to Clump
        The shapes by name; a sphere among clumps is a clump of one.
    materials : dict of str to Material
        The materials by name.
    contacts : dict of (str, str) to Contact
        For every pair of materials that can meet, named in any order.
    time_step_s : float
        Time step [s], above 0, at most `longest_time_step()`.
    capacity : int
        Most bodies.
    lower, upper : array_like (3,)
        A box in which most bodies stay [m]. It only steers the search for neighbours.
    walls : dict of str to Plane, Cone, RingEdge or Mesh, optional
        The walls by name.
    gravity_m_s2 : array_like (3,)
        Acceleration [m/s2].
    tension : {"keep", "release", "cut"}
        How a contact ends. "keep" lets the damped normal force pull at the end of an impact, so that a body leaves with
        the restitution asked for. "release" ends the contact when the force vanishes, with a damping that gives the
        restitution asked for all the same. "cut" ends it too and keeps the damping of "keep", so that bodies leave
        faster than asked for.
    friction_limit : {"elastic", "total"}, optional
        Which normal force limits friction and rolling resistance: its elastic part, or the size of all of it, damping
        included. By default "elastic" where the contact may pull and "total" where it may not: only these pairs obey
        Coulomb's law, by which a sliding impact has a tangential impulse of mu (1 + e) m V. The others are for
        comparisons with programs that have them.
    contact_law, rolling_law : str
        Names of force laws, see `repose.dem.laws`. "budget" resists each body's angular velocity in space by
        mu_r F_n R, R the distance of the contact from the centre of mass, spin about the normal included; so angular
        momentum is not kept, and where walls turn `rolling_frame_rad_s` must be set. "epsd" resists the rotation of
        one body against the other and keeps it.
    largest_scale : float
        The largest scale that `add` will be given.
    threads : int
        For a simulation of 4096 smooth bodies or more. The result is the same for any number. Clumps have one.
    exit_height_m : float
        A body that falls through this height gets an exit time.
    curved_walls_above_m : float
        All cones, cylinders and ring edges lie above this height. A body that was once wholly below it is not searched
        against them again.
    floor_height_m : float
        A body below this height is gone.

    Raises
    ------
    ValueError
        Naming the argument, the value and what is allowed.
    """

    def set_motion(self, wall: str, motion: Motion) -> None:
        """Give a wall another motion from now on.

        Parameters
        ----------
        wall : str
            Name of the wall.
        motion : Motion
            Its motion; the other walls go on with theirs.

        Raises
        ------
        ValueError
            For a name that is not a wall's, or a motion that is no `Motion`.
        """
        if not isinstance(motion, Motion):
            raise ValueError(f"motion is {motion!r}; expected a Motion")
        self.wall_set = self.wall_set.with_motion(wall, motion)
        self.walls = self._wall_arrays(self.walls, self.wall_set.names.index(wall))
        present = self.bodies.presence[: self.n_bodies] == st.PRESENT
        self.bodies.wall_check[: self.n_bodies][present] = -1.0
        self.bodies.wall_margin[:] = 0.0

    def _resists_against_space(self) -> bool:
        """Whether a wall turns while the frame of the rolling resistance does not."""
        if not (
            self.walls.approach[st.WALLS_MOVE] > 0.0 and self.walls.motion[:, 3:6].any()
        ):
            return False
        in_space = (
            self.rolling_law is ROLLING_LAWS["budget"]
            and not self.physics.rolling_frame.any()
        )
        return in_space and any(
            pair.rolling_friction > 0.0 for pair in self.contact_pairs.values()
        )

    @property
    def rolling_frame_rad_s(self) -> np.ndarray:
        """Angular velocity of the frame against which rolling is resisted, a view (3,); zero unless set [rad/s]."""
        return self.physics.rolling_frame

    def longest_time_step(
        self, speed_m_s: float = time_steps.FASTEST_IMPACT_M_S
    ) -> float:
        """Compute the longest time step for bodies of scale 1; it goes with the scale; see `repose.dem.time_steps`.

        An eighth of the shortest head-on impact of two bodies, or less where one pressed from both sides is unstable.

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
        The contact law has the duration; Hertz's is 2.868 (m*^2 / (R* E*^2 v))^0.2 (Johnson 1985, Eq. 11.24).
        """
        return time_steps.longest(
            self.scene, positive("speed_m_s", speed_m_s)
        ).time_step_s

    def add(
        self,
        shape: str,
        position_m: ArrayLike,
        quaternion: ArrayLike = (1.0, 0.0, 0.0, 0.0),
        velocity_m_s: ArrayLike = (0.0, 0.0, 0.0),
        angular_velocity_rad_s: ArrayLike = (0.0, 0.0, 0.0),
        scale: float = 1.0,
    ) -> int:
        """Add one body. Nothing checks that the place is free.

        Parameters
        ----------
        shape : str
            Name of its shape.
        position_m : array_like (3,)
            Its centre [m].
        quaternion : array_like (4,)
            Its orientation (w, x, y, z), body to world; any length but 0.
        velocity_m_s, angular_velocity_rad_s : array_like (3,)
            In the world frame [m/s, rad/s].
        scale : float
            Of its lengths, at most `largest_scale`; the time step sets a lower limit.

        Returns
        -------
        int
            The index of the body.

        Raises
        ------
        ValueError
            Naming the argument, also when the capacity is used up.
        """
        i = self.n_bodies
        if i >= self.capacity:
            raise ValueError(f"capacity is {self.capacity}; body {i + 1} does not fit")
        kind = chosen("shape", shape, self.shapes)
        least, most = self._smallest_scales[shape], self.largest_scale
        allowed = f"at least {least:.3g}, or time_step_s is too long, at most largest_scale, {most:g}"
        number("scale", scale, allowed, lambda scale: least <= scale <= most)
        place, turn = (
            vector("position_m", position_m),
            direction("quaternion", quaternion, 4),
        )
        velocity, spin = (
            vector("velocity_m_s", velocity_m_s),
            vector("angular_velocity_rad_s", angular_velocity_rad_s),
        )
        body = Body(kind, place, turn, velocity, spin, scale)
        write_body(self.bodies, i, body, self.physics.parts, self._body_tiles[0])
        self._shape_ids[i] = list(self.shapes).index(shape)
        self._scales[i] = scale
        self.bodies.kind[i] = self._numbers.of_bodies[kind.material]
        self.bodies.presence[i] = st.PRESENT
        self.bodies.wall_check[i] = -1.0
        self.bodies.resting[i // st.LANES] = 0
        self.bodies.wall_margin[i // st.LANES] = 0.0
        self.counts[st.N_BODIES] = i + 1
        self.grid.moved[i] = 1
        self.grid.moved_list[self.counts[st.N_MOVED]] = i
        self.counts[st.N_MOVED] += 1
        return i

    def glue(self, body: int) -> None:
        """Hold a body: no force moves or turns it any more, and others meet it as before.

        It stops. Its mass counts as 0, as of a body that is gone. Glued bodies must not overlap each other.

        Parameters
        ----------
        body : int
            Its index.

        Raises
        ------
        ValueError
            If there is no such body.
        """
        number(
            "body",
            body,
            f"an index below {self.n_bodies}",
            lambda k: 0 <= k < self.n_bodies and k == int(k),
        )
        inner = self._inner[body] if self._shared else body
        row = self.bodies.rows[inner]
        row[st.VELOCITY : st.VELOCITY + 3] = row[
            st.ANGULAR_VELOCITY : st.ANGULAR_VELOCITY + 3
        ] = 0.0
        row[st.INVERSE_MASS] = 0.0
        lanes = self.bodies.motion[inner // st.LANES, inner % st.LANES :: st.LANES]
        for rows in (st.INVERSE_MOMENTS, st.ANGULAR_MOMENTUM):
            lanes[rows // st.LANES : rows // st.LANES + 3] = 0.0

    def run_steps(self, steps: int) -> None:
        """Advance by a number of time steps.

        Parameters
        ----------
        steps : int
            How many, 0 or more.

        Raises
        ------
        ValueError
            Where that is no whole number, 0 or more.
        RuntimeError
            Where bodies overlap so much that a contact list overflows within one step.
        """
        left = whole_number("steps", steps, 0)
        if left > 0 and self._resists_against_space():
            warnings.warn(TURNING, stacklevel=2)
        while left > 0:
            left -= self._advance(left)
            if self.counts[st.FULL]:
                raise RuntimeError(
                    "a contact list overflowed within one step; bodies overlap wildly"
                )
            if left > 0:
                self._grow()

    def _advance(self, steps: int) -> int:
        """Advance by at most `steps`, or fewer where a list has to grow; returns the number made."""
        lists = (self.bodies, self.pairs, self.flat, self.curved, self.meshed)
        world = (self.grid, self.walls, self.meshes, self.counts, self.physics)
        if not self._shared:
            scratch = (self._tiles[0], self._body_tiles[0], self._scratches[0])
            return advance(*lists, self.clumps, *world, *scratch, steps)
        if self.steps % parallel.REORDER_EVERY == 0:
            self._renumber()
        steps = min(steps, parallel.REORDER_EVERY - self.steps % parallel.REORDER_EVERY)
        shared = st.Shared(
            counters=np.zeros(BARRIER_SIZE, np.int64),
            orders=np.zeros(1, np.int64),
            **st.each("begins numbers", parallel.SHARES, np.int64),
            due=np.zeros(len(self.pairs.near_limit), np.int64),
        )
        tiles = (self._tiles, self._body_tiles, self._scratches)
        return parallel.run_threads((*lists, *world), tiles, shared, steps)

    def _renumber(self) -> None:
        """Give the bodies numbers in spatial order; for users they keep their numbers."""
        n = self.n_bodies
        order = reorder(
            self.bodies,
            self.grid,
            self.pairs,
            self.flat,
            self.curved,
            self.meshed,
            self.counts,
        )
        self._outer[:n] = self._outer[:n][order]
        self._inner[self._outer[:n]] = np.arange(n)

    def _grow(self) -> None:
        """Double the lists that are filling up; each in one move, since an interrupt could leave half a list."""
        counts, capacity = self.counts, self.capacity
        self.pairs = contact_lists.grown_pairs(
            self.pairs, counts, capacity, self._most_spheres, self._n_state
        )
        self.flat = contact_lists.grown_wall_contacts(
            self.flat, counts[st.N_PLANE], capacity
        )
        self.curved = contact_lists.grown_wall_contacts(
            self.curved, counts[st.N_CURVED], capacity
        )
        meshed = contact_lists.grown_wall_contacts(
            self.meshed, counts[st.N_MESHED], capacity
        )
        if self._of_clumps:
            more = len(meshed.body) - len(self.clumps.mesh_sphere)
            self.clumps = self.clumps._replace(
                mesh_sphere=np.pad(self.clumps.mesh_sphere, (0, more))
            )
        self.meshed = meshed

    def run(
        self,
        seconds: float,
        progress: Callable[[float], Any] | bool | None = None,
        *,
        record: Callable[["Simulation"], Any]
        | Sequence[Callable[["Simulation"], Any]]
        | None = None,
        record_every_s: float | None = None,
        checkpoint: str | os.PathLike | None = None,
        every_s: float = 600.0,
    ) -> None:
        """Advance by simulated time, to the nearest time step. Ctrl-C ends it between two steps.

        Of the arguments only `seconds` affects the result.

        Parameters
        ----------
        seconds : float
            Simulated time [s].
        progress : callable or False, optional
            A function is called with the simulated time at intervals. False is silent. By default there is a bar where
            stderr is a terminal, and a line a minute where it is not.
        record : callable or sequence of callables, optional
            Called with the simulation at time 0 and then every `record_every_s`, such as a `Recorder` or a `VtkSeries`.
        record_every_s : float, optional
            Simulated time between two records [s].
        checkpoint : path, optional
            A file that `save` writes at intervals, at the end, and on Ctrl-C.
        every_s : float
            Wall time between two checkpoints [s].

        Raises
        ------
        ValueError
            Naming the argument.
        """
        begin_s, dt = self.time_s, self.time_step_s
        end = self.steps + round(not_negative("seconds", seconds) / dt)
        recorders = _recorders(record)
        between = _steps_between(record_every_s, dt) if recorders else 0
        positive("every_s", every_s)
        chunk, saved = FIRST_CHUNK, time.monotonic()
        with display(begin_s, end * dt, dt, progress) as report:
            try:
                if self.steps == 0:
                    self._record(recorders)
                while self.steps < end:
                    steps = min(end - self.steps, chunk)
                    if recorders:
                        steps = min(steps, between - self.steps % between)
                    began = time.perf_counter()
                    self.run_steps(steps)
                    chunk = _next_chunk(steps, time.perf_counter() - began)
                    if recorders and self.steps % between == 0:
                        self._record(recorders)
                    report(self.time_s)
                    if checkpoint is not None and time.monotonic() - saved >= every_s:
                        self.save(checkpoint)
                        saved = time.monotonic()
            except KeyboardInterrupt:
                if checkpoint is not None:
                    self.save(checkpoint)
                raise
        if checkpoint is not None:
            self.save(checkpoint)

    def _record(self, recorders: list[Callable[["Simulation"], Any]]) -> None:
        """Call each recorder with the simulation."""
        for recorder in recorders:
            recorder(self)

    def save(self, path: str | os.PathLike) -> None:
        """Write everything to a file (.npz without pickle), in one move, for `load`.

        Parameters
        ----------
        path : path
            The file.
        """
        checkpoints.save(self, path)

    @classmethod
    def load(cls, path: str | os.PathLike) -> "Simulation":
        """Read the simulation that `save` wrote; it goes on with the same bits as if it had never stopped.

        Parameters
        ----------
        path : path
            The file.

        Returns
        -------
        Simulation
            In the state in which it was saved.

        Raises
        ------
        repose.dem.errors.InputError
            A ValueError that names the file where it is missing, damaged, of another format, or written by other
            sources of the engine.
        """
        return checkpoints.load(cls, path)


def _recorders(record: Any) -> list[Callable[[Simulation], Any]]:
    """Return the argument `record` of `Simulation.run` as a list."""
    recorders = (
        []
        if record is None
        else list(record)
        if isinstance(record, list | tuple)
        else [record]
    )
    if not all(callable(recorder) for recorder in recorders):
        raise ValueError(
            f"record is {record!r}; expected a function of the simulation, or a list of them"
        )
    return recorders


def _steps_between(record_every_s: float | None, dt: float) -> int:
    """Count the steps between two records."""
    if record_every_s is None:
        raise ValueError(
            "record_every_s is None; expected above 0 where there is something to record"
        )
    return max(1, round(positive("record_every_s", record_every_s) / dt))


def _next_chunk(steps: int, took_s: float) -> int:
    """Choose the steps that take about CHUNK_S, where `steps` took `took_s`; the time to compile counts, too."""
    wanted = steps * CHUNK_S / max(took_s, 1e-6)
    return max(1, round(min(max(wanted, 0.1 * steps), 10.0 * steps)))
