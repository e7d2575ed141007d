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
        gravity_vector = np.asarray(simulation.physics.gravity)
        self.gravity = float(np.linalg.norm(gravity_vector))
        # Without gravity no direction is up, and all heights are 0.
        self.up = -gravity_vector / (self.gravity or 1.0)
        self.lowest_m, self.fall_m = self._find_lowest_and_fall(top_m)
        # No grain is faster than after the deepest fall with the largest given speed.
        fall_speed_m_s = math.sqrt(2.0 * self.gravity * self.fall_m)
        self.fastest_m_s = SPEED_LIMIT * (fall_speed_m_s + speed_m_s)
        # Smallest extent of a grain of the scale 1.
        self.thickness_m = 2.0 * min(
            float(shape.half_extents_m.min()) for shape in simulation.shapes.values()
        )
        self.broken = ""
        self.overlap_share = 0.0
        self._last_check = 0

    def _find_lowest_and_fall(self, top_m: float) -> tuple[float, float]:
        """Compute the lowest height in the box and the deepest fall through it.

        Parameters
        ----------
        top_m : float
            Largest z at which a grain is added [m]. It replaces the upper end of the box.

        Returns
        -------
        lowest_m : float
            The lowest height of the box. Heights are measured against gravity, which
            may be tilted.
        fall_m : float
            The difference between the largest height and the lowest one.
        """
        lower_corner = self.simulation.lower.copy()
        # Grains may fall below the box, to the height at which they vanish.
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
        """Guard the block of a ``with`` statement against broken bounds.

        The grains are checked at the end of the block. The first broken bound ends the
        block. Its message is kept in `broken`, and its error goes no further.
        """
        try:
            yield
            self.look()
        except Unstable as error:
            self.broken = str(error)

    def run_to(self, step: int) -> None:
        """Advance to a time step, and check the grains at regular intervals.

        The call does nothing if the simulation has reached the step already.

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
            # Stop where the next check is due, or before it at the given time step.
            next_check = self._last_check + CHECK_INTERVAL
            next_stop = min(step, next_check)
            try:
                simulation.run_steps(next_stop - simulation.steps)
            except RuntimeError as error:
                # The engine stops at a contact whose force is not a number.
                raise Unstable(
                    f"{error}, {self._describe_time()}: {self._describe_remedy()}"
                ) from None
            if simulation.steps >= next_check:
                is_full_check = simulation.steps % full_check_interval == 0
                self.look(everywhere=is_full_check)

    def look(self, everywhere: bool = True) -> None:
        """Check the grains as they are now.

        Parameters
        ----------
        everywhere : bool, optional
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
        # A grain without a finite state counts as infinitely fast.
        has_finite_speed = np.isfinite(squared_speeds)
        has_finite_position = np.isfinite(simulation.positions).all(axis=1)
        is_finite = has_finite_speed & has_finite_position
        squared_speeds[~is_finite] = np.inf

        fastest_grain = int(np.argmax(squared_speeds))
        speed_m_s = math.sqrt(squared_speeds[fastest_grain])
        if speed_m_s <= self.fastest_m_s:
            return
        if math.isfinite(speed_m_s):
            motion = f"moves at {speed_m_s:.3g} m/s"
        else:
            motion = "has no finite position or speed"
        raise Unstable(
            f"grain {fastest_grain} {motion}, {self._describe_time()}: "
            f"{self._describe_remedy()}; "
            f"none here can be faster than {self.fastest_m_s:.3g} m/s"
        )

    def _check_energy(self) -> None:
        """Raise `Unstable` if the grains have more energy than they can have received.

        They can have received at most the energy of a fall from the top of the scene,
        plus that of the largest speed of grains and walls.
        """
        simulation = self.simulation
        present = simulation.present
        kinetic_j = simulation.kinetic_energies()[present]
        masses_kg = simulation.masses_kg[present]
        heights_m = simulation.positions[present] @ self.up - self.lowest_m
        total_j = float(kinetic_j.sum() + self.gravity * np.sum(masses_kg * heights_m))
        given_j_per_kg = self.gravity * self.fall_m + 0.5 * self.speed_m_s**2
        given_j = float(masses_kg.sum()) * given_j_per_kg
        if not total_j > (1.0 + ENERGY_TOLERANCE) * given_j:
            return
        # The grain with most kinetic energy is the likeliest cause.
        suspect = int(np.flatnonzero(present)[np.argmax(kinetic_j)])
        raise Unstable(
            f"grain {suspect} has {kinetic_j.max():.3g} J, "
            f"{self._describe_time()}: {self._describe_remedy()}; all grains together "
            f"have {total_j:.3g} J and were given {given_j:.3g} J"
        )

    def _check_overlaps(self) -> None:
        """Raise `Unstable` if grains pass through each other or through walls.

        Sets `overlap_share` to the largest overlap of all contacts, as a share of the
        thickness of the grain.
        """
        simulation = self.simulation
        self.overlap_share = 0.0

        # An overlap of two grains is judged by the thickness of the smaller one.
        pairs, pair_overlaps = simulation.overlaps()
        smaller_scales = simulation.scales[pairs].min(axis=1)
        deepest_pair = self._find_too_deep(pair_overlaps, smaller_scales)
        if deepest_pair is not None:
            first, second = pairs[deepest_pair]
            raise self._overlap_error(
                f"grains {first} and {second}", pair_overlaps[deepest_pair]
            )

        grains, walls, wall_overlaps = simulation.wall_overlaps()
        grain_scales = simulation.scales[grains]
        deepest_contact = self._find_too_deep(wall_overlaps, grain_scales)
        if deepest_contact is not None:
            grain = grains[deepest_contact]
            wall_name = simulation.wall_set.names[walls[deepest_contact]]
            raise self._overlap_error(
                f"grain {grain} and the wall {wall_name!r}",
                wall_overlaps[deepest_contact],
            )

    def shares(self, overlaps: np.ndarray, scales: np.ndarray) -> np.ndarray:
        """Divide overlaps (M,) [m] by the smallest extents of grains of scales (M,)."""
        return overlaps / scales / self.thickness_m

    def _find_too_deep(self, overlaps: np.ndarray, scales: np.ndarray) -> int | None:
        """Find the deepest overlap, if it is too deep for a contact.

        As a second effect, `overlap_share` grows to the share of the deepest overlap,
        even if that is not too deep.

        Parameters
        ----------
        overlaps : array
            Overlaps (M,) [m]; there may be none.
        scales : array
            Relative sizes (M,) of the grains by which they are judged.

        Returns
        -------
        int or None
            Index of the deepest overlap; None if it is not above `OVERLAP_LIMIT`.
        """
        if not len(overlaps):
            return None
        shares = self.shares(overlaps, scales)
        deepest = int(np.argmax(shares))
        self.overlap_share = max(self.overlap_share, float(shares[deepest]))
        return deepest if shares[deepest] > OVERLAP_LIMIT else None

    def _overlap_error(self, bodies: str, overlap_m: float) -> Unstable:
        """Make the error about two bodies, given in words, that overlap too deeply."""
        return Unstable(
            f"{bodies} overlap by {1e3 * overlap_m:.3g} mm, {self._describe_time()}: a "
            "higher berry.shear_modulus_pa, or a shorter simulation.time_step_s than "
            f"{self.simulation.time_step_s:.3g}, helps; at most {100 * OVERLAP_LIMIT:g} % of "
            "the smallest extent is a contact"
        )

    def _describe_time(self) -> str:
        """Write the simulated time of a fault."""
        return f"after {self.simulation.time_s:.3g} s"

    def _describe_remedy(self) -> str:
        """Write the remedy for a time step that is too long."""
        step_s = self.simulation.time_step_s
        return f"a shorter simulation.time_step_s than {step_s:.3g} helps"
