"""Check speed, energy and overlap, and end a run whose simulation is unstable."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np

from repose.common.numbers import format_significant

if TYPE_CHECKING:
    from repose import dem

# Largest speed of a grain over that of the deepest fall. A small grain that is struck
# by large ones becomes faster than they are.
SPEED_LIMIT = 3.0
# Largest gain of energy over the energy that was given. Impacts of smooth bodies
# without friction may return more energy than they received, see docs/verification.md.
ENERGY_TOLERANCE = 0.1
# Largest overlap over the smallest extent of a grain.
OVERLAP_LIMIT = 0.5
# The record of a run notes an overlap above this fraction, because the contact laws are
# made for small overlaps.
NOTED_OVERLAP = 0.1
# Time steps between two checks of the speeds.
CHECK_INTERVAL = 2000
# Checks of the speeds for each full check, which also covers energy and overlaps and
# takes ten times as long.
SPEED_CHECKS_PER_FULL_CHECK = 5


class Unstable(Exception):
    """An error for a run that exceeds a limit; it names the grain, time and remedy."""


class Bounded:
    """Advances a simulation, and checks its grains at intervals.

    Parameters
    ----------
    simulation : repose.dem.Simulation
        The simulation, with its walls and box.
    top_m : float
        Largest height [m] at which a grain is added or to which it is lifted.
    speed_m_s : float, optional
        Largest speed that a grain or a wall is given.

    Attributes
    ----------
    broken : str
        Message about the limit that was exceeded inside `guard`. It is empty as long as
        the run is stable.
    overlap_share : float
        Largest overlap at the last check of overlaps, over the smallest extent of the
        smaller grain. The last check of a run is made in the state that is measured.
    """

    def __init__(
        self, simulation: "dem.Simulation", top_m: float, speed_m_s: float = 0.0
    ) -> None:
        """Compute the limits of speed and energy for a scene.

        The class documents the parameters.
        """
        self.simulation = simulation
        self.speed_m_s = speed_m_s
        gravity_vector = np.asarray(simulation.physics.gravity)
        self.gravity = float(np.linalg.norm(gravity_vector))
        # Unit vector upwards. Without gravity no direction is up, and all heights are
        # 0.
        self.up = -gravity_vector / (self.gravity or 1.0)
        # This needs the attribute `up`.
        self.lowest_m, self.fall_m = self._find_lowest_and_fall(top_m)
        # The largest allowed speed is `SPEED_LIMIT` times the sum of two speeds: that
        # after the deepest fall, and the largest one that a grain or a wall is given.
        fall_speed_m_s = math.sqrt(2.0 * self.gravity * self.fall_m)
        self.fastest_m_s = SPEED_LIMIT * (fall_speed_m_s + speed_m_s)
        # The smallest extent of a grain whose scale is 1
        self.thickness_m = 2.0 * min(
            float(shape.half_extents_m.min()) for shape in simulation.shapes.values()
        )
        # Empty as long as no limit is exceeded
        self.broken = ""
        self.overlap_share = 0.0
        self._last_checked_step = 0

    def _find_lowest_and_fall(self, top_m: float) -> tuple[float, float]:
        """Compute the smallest height in the box, and the largest possible fall.

        A height is a distance along `up`, the direction opposite to gravity. Gravity
        may be tilted against the box.

        Parameters
        ----------
        top_m : float
            Largest z at which a grain is added [m]. It replaces the upper end of the
            box.

        Returns
        -------
        lowest_m : float
            The smallest height in the box.
        fall_m : float
            The difference between the largest height and the smallest one.
        """
        lower_corner = self.simulation.lower.copy()
        # Grains may fall below the box, to the height at which they are removed.
        floor_z = float(self.simulation.physics.floor_height)
        if math.isfinite(floor_z):
            lower_corner[2] = min(lower_corner[2], floor_z)
        upper_corner = np.array([*self.simulation.upper[:2], top_m])
        # The height of a corner is the sum of three parts, one for each axis of the
        # box. Gravity may point in any direction, so on each axis either end may be the
        # lower one. The rows are the parts of both corners; sorting puts the smaller
        # part of each axis into the first row.
        height_parts = np.sort(self.up * [lower_corner, upper_corner], axis=0)
        lowest_m, highest_m = height_parts.sum(axis=1)
        return lowest_m, float(highest_m - lowest_m)

    @contextmanager
    def guard(self) -> Iterator[None]:
        """End the block of a ``with`` statement as soon as a limit is exceeded.

        The grains are also checked at the end of the block. The error `Unstable` is
        caught here, so the caller goes on after the block. It finds the message in
        `broken`.
        """
        try:
            yield
            self.check()
        except Unstable as error:
            self.broken = str(error)

    def run_to(self, step: int) -> None:
        """Advance to a time step, and check the grains at regular intervals.

        Nothing happens if the simulation has reached the step already.

        Parameters
        ----------
        step : int
            The time step, counted from the beginning of the simulation.

        Raises
        ------
        Unstable
            If a limit is exceeded on the way.
        """
        simulation = self.simulation
        full_check_interval = SPEED_CHECKS_PER_FULL_CHECK * CHECK_INTERVAL
        while simulation.steps < step:
            # Stop at the next check, or at the given time step if that comes first.
            # `check` updates `_last_checked_step`.
            next_check = self._last_checked_step + CHECK_INTERVAL
            next_stop = min(step, next_check)
            try:
                simulation.run_steps(next_stop - simulation.steps)
            except RuntimeError as error:
                # The engine raises this error if bodies overlap so much that a list of
                # contacts overflows within one time step.
                raise Unstable(
                    f"{error}, {self._describe_time()}: {self._describe_remedy()}"
                ) from None
            if simulation.steps >= next_check:
                is_full_check = simulation.steps % full_check_interval == 0
                self.check(is_full=is_full_check)

    def check(self, is_full: bool = True) -> None:
        """Check the present state of the grains.

        Parameters
        ----------
        is_full : bool, optional
            Whether to check energy and overlaps, too, which takes longer than the check
            of the speeds.

        Raises
        ------
        Unstable
            If a limit is exceeded.
        """
        # A check of an empty simulation counts as well: `run_to` plans the next one
        # from here.
        self._last_checked_step = self.simulation.steps
        if not self.simulation.n_bodies:
            return
        self._check_speeds()
        if is_full:
            self._check_energy()
            self._check_overlaps()

    def _check_speeds(self) -> None:
        """Check that the state of all grains is finite, and that none is too fast.

        Raises
        ------
        Unstable
            If the fastest grain is faster than `fastest_m_s` [m/s], or if a position or
            speed is not finite. The message gives the number of the grain.
        """
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
            motion = f"moves at {format_significant(speed_m_s, 3)} m/s"
        else:
            motion = "has no finite position or speed"
        raise Unstable(
            f"grain {fastest_grain} {motion}, {self._describe_time()}: "
            f"{self._describe_remedy()}; "
            f"none here can be faster than {format_significant(self.fastest_m_s, 3)} m/s"
        )

    def _check_energy(self) -> None:
        """Check that the grains do not have more energy than they can have received.

        A grain can have received at most the energy of the deepest fall (`fall_m`), and
        the kinetic energy of the largest speed that grains or walls are given
        (`speed_m_s`).

        Raises
        ------
        Unstable
            If all grains together have too much energy. The message names the grain
            with the largest kinetic energy.
        """
        simulation = self.simulation
        # Mask of the grains that have not been removed
        present = simulation.present
        kinetic_j = simulation.kinetic_energies()[present]
        masses_kg = simulation.masses_kg[present]
        heights_m = simulation.positions[present] @ self.up - self.lowest_m
        # The energy of all grains: kinetic, and potential above the smallest height
        total_j = float(kinetic_j.sum() + self.gravity * np.sum(masses_kg * heights_m))
        # The largest energy that they can have received
        given_j_per_kg = self.gravity * self.fall_m + 0.5 * self.speed_m_s**2
        given_j = float(masses_kg.sum()) * given_j_per_kg
        # A sum that is NaN passes this check. `_check_speeds` finds states that are not
        # finite.
        if not total_j > (1.0 + ENERGY_TOLERANCE) * given_j:
            return
        # The grain with the largest kinetic energy is the most likely cause.
        # `kinetic_j` has only present grains, so convert its index to that of all
        # grains.
        suspect = int(np.flatnonzero(present)[np.argmax(kinetic_j)])
        suspect_j = float(kinetic_j.max())
        raise Unstable(
            f"grain {suspect} has {format_significant(suspect_j, 3)} J, "
            f"{self._describe_time()}: {self._describe_remedy()}; all grains together "
            f"have {format_significant(total_j, 3)} J and were given {format_significant(given_j, 3)} J"
        )

    def _check_overlaps(self) -> None:
        """Check that no grain passes through another one or through a wall.

        The check sets `overlap_share` to the largest overlap of all contacts, as a
        fraction of the smallest extent of the grain. `_find_excessive_overlap` updates
        it, first for pairs of grains and then for contacts with walls.

        Raises
        ------
        Unstable
            If two grains, or a grain and a wall, overlap too deeply. The message names
            them.
        """
        simulation = self.simulation
        # Forget the overlaps of the last check.
        self.overlap_share = 0.0

        # The overlap of two grains is compared with the thickness of the smaller grain.
        pairs, pair_overlaps = simulation.overlaps()
        smaller_scales = simulation.scales[pairs].min(axis=1)
        deepest_pair = self._find_excessive_overlap(pair_overlaps, smaller_scales)
        if deepest_pair is not None:
            first, second = pairs[deepest_pair]
            raise self._make_overlap_error(
                f"grains {first} and {second}", pair_overlaps[deepest_pair]
            )

        grains, walls, wall_overlaps = simulation.wall_overlaps()
        grain_scales = simulation.scales[grains]
        deepest_contact = self._find_excessive_overlap(wall_overlaps, grain_scales)
        if deepest_contact is not None:
            grain = grains[deepest_contact]
            wall_name = simulation.wall_set.names[walls[deepest_contact]]
            raise self._make_overlap_error(
                f"grain {grain} and the wall {wall_name!r}",
                wall_overlaps[deepest_contact],
            )

    def compute_overlap_shares(
        self, overlaps: np.ndarray, scales: np.ndarray
    ) -> np.ndarray:
        """Compute overlaps as fractions of the smallest extents of their grains.

        Parameters
        ----------
        overlaps : array
            Overlaps (M,) [m].
        scales : array
            Relative sizes (M,) of the grains.

        Returns
        -------
        array
            The fractions (M,).
        """
        return overlaps / scales / self.thickness_m

    def _find_excessive_overlap(
        self, overlaps: np.ndarray, scales: np.ndarray
    ) -> int | None:
        """Find the deepest overlap if it is too deep for a contact.

        The attribute `overlap_share` is raised to the fraction of this overlap if that
        is larger than its present value.

        Parameters
        ----------
        overlaps : array
            Overlaps (M,) [m]. The array may be empty.
        scales : array
            Relative sizes (M,) of the grains whose smallest extent limits the overlaps.

        Returns
        -------
        int or None
            Index of the deepest overlap; None if it is not above `OVERLAP_LIMIT`.
        """
        if not len(overlaps):
            return None
        shares = self.compute_overlap_shares(overlaps, scales)
        deepest = int(np.argmax(shares))
        self.overlap_share = max(self.overlap_share, float(shares[deepest]))
        return deepest if shares[deepest] > OVERLAP_LIMIT else None

    def _make_overlap_error(self, bodies: str, overlap_m: float) -> Unstable:
        """Make the error about two bodies that overlap too deeply.

        `bodies` is the phrase that names them in the message.
        """
        return Unstable(
            f"{bodies} overlap by {format_significant(1e3 * overlap_m, 3)} mm, "
            f"{self._describe_time()}: a higher berry.shear_modulus_pa, or a shorter "
            f"simulation.time_step_s than {format_significant(self.simulation.time_step_s, 3)}, "
            f"helps; at most {100 * OVERLAP_LIMIT:g} % of the smallest extent is a contact"
        )

    def _describe_time(self) -> str:
        """Return the present simulated time as a phrase for a message."""
        return f"after {format_significant(self.simulation.time_s, 3)} s"

    def _describe_remedy(self) -> str:
        """Return the advice for a message about a time step that is too long."""
        step_s = self.simulation.time_step_s
        return f"a shorter simulation.time_step_s than {format_significant(step_s, 3)} helps"
