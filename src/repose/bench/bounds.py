"""Check speed, energy and overlap, and end a run whose simulation is unstable."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from repose import dem

# Largest speed over that of a fall: a small grain between large ones leaves faster.
SPEED_LIMIT = 3.0
# Energy gained over energy given: impacts of smooth bodies without friction may return
# more than they took, see docs/verification.md.
ENERGY_TOLERANCE = 0.1
# Largest overlap over the smallest extent of a grain.
OVERLAP_LIMIT = 0.5
# A record notes an overlap above this share: forces of contacts hold for small ones.
NOTED_OVERLAP = 0.1
# Time steps between two checks of the speeds.
CHECK_INTERVAL = 2000
# Checks of the speeds per check of energy and overlaps, which takes ten times as long.
SPEED_CHECKS_PER_FULL_CHECK = 5


class Unstable(Exception):
    """A bound is broken; the message names the grain, the time and the remedy."""


class Bounded:
    """Advances a simulation and checks its grains on the way.

    Parameters
    ----------
    simulation : repose.dem.Simulation
        The simulation, with its walls and box.
    top_m : float
        Largest height, against gravity, to which a grain is brought.
    speed_m_s : float, optional
        Largest speed that a grain or a wall is given.

    Attributes
    ----------
    broken : str
        Message about the bound that was broken inside `guard`; empty if none was.
    overlap_share : float
        Largest overlap at the last check of overlaps, over the smallest extent of the
        smaller grain. The last check is that of the state that is measured.
    """

    def __init__(
        self, simulation: "dem.Simulation", top_m: float, speed_m_s: float = 0.0
    ) -> None:
        """Compute the bounds of speed and energy from the scene; see the class."""
        self.simulation = simulation
        self.speed_m_s = speed_m_s
        gravity = np.asarray(simulation.physics.gravity)
        self.gravity = float(np.linalg.norm(gravity))
        # Without gravity no direction is up, and all heights are 0.
        self.up = -gravity / (self.gravity or 1.0)
        self.lowest_m, self.fall_m = self._find_lowest_and_fall(top_m)
        # No grain is faster than after the deepest fall with the largest given speed.
        self.fastest_m_s = SPEED_LIMIT * (
            math.sqrt(2.0 * self.gravity * self.fall_m) + speed_m_s
        )
        # Smallest extent of a grain of the scale 1.
        self.thickness_m = 2.0 * min(
            float(shape.half_extents_m.min()) for shape in simulation.shapes.values()
        )
        self.broken = ""
        self.overlap_share = 0.0
        self._last_check = 0

    def _find_lowest_and_fall(self, top_m: float) -> tuple[float, float]:
        """Compute the lowest height in the box and the deepest fall through it [m].

        Heights are measured against gravity, which may be tilted.
        """
        lower_corner = self.simulation.lower.copy()
        floor_z = float(self.simulation.physics.floor_height)
        if math.isfinite(floor_z):
            lower_corner[2] = min(lower_corner[2], floor_z)
        upper_corner = np.array([*self.simulation.upper[:2], top_m])
        # A height is the sum of three parts, one for each axis of the box. Gravity may
        # point along any axis, so either end of an axis may be the lower one.
        height_parts = np.sort(self.up * [lower_corner, upper_corner], axis=0)
        lowest_m, highest_m = height_parts.sum(axis=1)
        return lowest_m, float(highest_m - lowest_m)

    @contextmanager
    def guard(self) -> Iterator[None]:
        """Run a block up to the first broken bound, and check the grains at its end.

        The message about a broken bound is kept in `broken`.
        """
        try:
            yield
            self.look()
        except Unstable as error:
            self.broken = str(error)

    def run_to(self, step: int) -> None:
        """Advance to a time step, and check the grains at regular intervals.

        Do nothing if the simulation is there already.

        Parameters
        ----------
        step : int
            The time step, counted from the beginning of the simulation.

        Raises
        ------
        Unstable
            If a bound is broken on the way.
        """
        simulation = self.simulation
        full_check_interval = SPEED_CHECKS_PER_FULL_CHECK * CHECK_INTERVAL
        while simulation.steps < step:
            next_check = self._last_check + CHECK_INTERVAL
            stop = min(step, next_check)
            try:
                simulation.run_steps(stop - simulation.steps)
            except RuntimeError as error:
                # The engine stops at a contact whose force is not a number.
                raise Unstable(
                    f"{error}, {self._time()}: {self._shorter_step()}"
                ) from None
            if simulation.steps >= next_check:
                is_full_check = simulation.steps % full_check_interval == 0
                self.look(everywhere=is_full_check)

    def look(self, everywhere: bool = True) -> None:
        """Check the grains as they are now.

        Parameters
        ----------
        everywhere : bool
            Whether to check energy and overlaps too, which takes longer than the
            speeds.

        Raises
        ------
        Unstable
            If a bound is broken.
        """
        self._last_check = self.simulation.steps
        if not self.simulation.n_bodies:
            return
        self._check_speeds()
        if everywhere:
            self._check_energy()
            self._check_overlaps()

    def _check_speeds(self) -> None:
        """Raise `Unstable` for a position that is not finite, or an impossible speed."""
        simulation = self.simulation
        squared_speeds = np.square(simulation.velocities).sum(axis=1)
        has_finite_speed = np.isfinite(squared_speeds)
        has_finite_position = np.isfinite(simulation.positions).all(axis=1)
        # A grain without a finite state counts as infinitely fast.
        squared_speeds[~(has_finite_speed & has_finite_position)] = np.inf
        fastest = int(np.argmax(squared_speeds))
        speed = math.sqrt(squared_speeds[fastest])
        if speed <= self.fastest_m_s:
            return
        if math.isfinite(speed):
            motion = f"moves at {speed:.3g} m/s"
        else:
            motion = "has no finite position or speed"
        raise Unstable(
            f"grain {fastest} {motion}, {self._time()}: {self._shorter_step()}; "
            f"none here can be faster than {self.fastest_m_s:.3g} m/s"
        )

    def _check_energy(self) -> None:
        """Raise `Unstable` if the grains together have more energy than they were given.

        They were given at most that of a fall from the top of the scene, and that of
        the largest speed of grains and walls.
        """
        simulation = self.simulation
        present = simulation.present
        kinetic = simulation.kinetic_energies()[present]
        masses = simulation.masses_kg[present]
        heights = simulation.positions[present] @ self.up - self.lowest_m
        energy = float(kinetic.sum() + self.gravity * np.sum(masses * heights))
        energy_given = float(masses.sum()) * (
            self.gravity * self.fall_m + 0.5 * self.speed_m_s**2
        )
        if energy > (1.0 + ENERGY_TOLERANCE) * energy_given:
            # The grain with most kinetic energy is the likeliest cause.
            suspect = int(np.flatnonzero(present)[np.argmax(kinetic)])
            raise Unstable(
                f"grain {suspect} has {kinetic.max():.3g} J, "
                f"{self._time()}: {self._shorter_step()}; all grains together have "
                f"{energy:.3g} J and were given {energy_given:.3g} J"
            )

    def _check_overlaps(self) -> None:
        """Raise `Unstable` if grains pass through each other or through walls.

        The largest overlap of all contacts is kept as `overlap_share`.
        """
        simulation = self.simulation
        self.overlap_share = 0.0

        # An overlap is judged by the thickness of the smaller grain.
        pairs, pair_overlaps = simulation.overlaps()
        smaller_scales = simulation.scales[pairs].min(axis=1)
        pair = self._find_excess(pair_overlaps, smaller_scales)
        if pair is not None:
            first, second = pairs[pair]
            self._raise_overlap(f"grains {first} and {second}", pair_overlaps[pair])

        grains, walls, wall_overlaps = simulation.wall_overlaps()
        contact = self._find_excess(wall_overlaps, simulation.scales[grains])
        if contact is not None:
            wall = simulation.wall_set.names[walls[contact]]
            bodies = f"grain {grains[contact]} and the wall {wall!r}"
            self._raise_overlap(bodies, wall_overlaps[contact])

    def shares(self, overlaps: np.ndarray, scales: np.ndarray) -> np.ndarray:
        """Divide overlaps by the smallest extents of grains of these scales."""
        return overlaps / scales / self.thickness_m

    def _find_excess(self, overlaps: np.ndarray, scales: np.ndarray) -> int | None:
        """Find the deepest of M overlaps (M,) of grains of these scales (M,).

        Return its index if it is above `OVERLAP_LIMIT`, else None; `overlap_share`
        grows to it in both cases.
        """
        if not len(overlaps):
            return None
        shares = self.shares(overlaps, scales)
        deepest = int(np.argmax(shares))
        self.overlap_share = max(self.overlap_share, float(shares[deepest]))
        return deepest if shares[deepest] > OVERLAP_LIMIT else None

    def _raise_overlap(self, bodies: str, overlap_m: float) -> None:
        """Raise `Unstable` for two bodies that overlap too deeply."""
        raise Unstable(
            f"{bodies} overlap by {1e3 * overlap_m:.3g} mm, {self._time()}: a higher "
            "berry.shear_modulus_pa, or a shorter simulation.time_step_s than "
            f"{self.simulation.time_step_s:.3g}, helps; at most {100 * OVERLAP_LIMIT:g} % of "
            "the smallest extent is a contact"
        )

    def _time(self) -> str:
        """Write the simulated time of a fault."""
        return f"after {self.simulation.time_s:.3g} s"

    def _shorter_step(self) -> str:
        """Write the remedy for a time step that is too long."""
        step_s = self.simulation.time_step_s
        return f"a shorter simulation.time_step_s than {step_s:.3g} helps"
