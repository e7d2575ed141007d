"""Bounds that no pour breaks while its time step is short enough and its grains are stiff enough.

A step that is too long feeds energy into contacts, and grains fly off; grains that are too soft pass through each
other and through walls. Either may end in a pile that looks like one. So a run looks at its grains now and then, and
ends with the status ``unstable`` where one of the bounds is broken:

- speed: `FASTEST` times that of a fall through the whole scene with the speed that grains or walls are given;
- energy: motion and height of all grains together, which nothing but a moving wall can raise: at most what they have
  at the top of the scene with the speed that they are given, and `GAIN` of it more;
- overlap: of two grains at most `DEEPEST` of the smallest extent of the smaller one, of a grain and a wall at most as
  much of the grain's.

Looking changes nothing in the simulation.
"""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from repose import dem

FASTEST = 3.0  # a small grain between large ones leaves faster than they came
GAIN = 0.1  # hits of smooth bodies without friction may return more than they took, see docs/verification.md
DEEPEST = 0.5
EVERY = 2000  # time steps between two looks at the speeds
SELDOM = 5  # looks from one check of energy and overlaps to the next; they are checked at the end, too
CURE = {
    "time step": "a shorter simulation.time_step_s than {:.3g} helps",
    "modulus": "a higher berry.shear_modulus_pa, or a shorter simulation.time_step_s than {:.3g}, helps",
}


class Unstable(Exception):
    """A run that broke a bound. The text is its reason: grain, time and remedy."""


class Bounded:
    """Advances a simulation and looks at its grains on the way.

    `top_m` is the largest height, along gravity, that a grain is brought to, `speed_m_s` the largest speed that a grain
    or a wall is given; the scene is its box up to `top_m`.
    """

    def __init__(
        self, simulation: "dem.Simulation", top_m: float, speed_m_s: float = 0.0
    ) -> None:
        self.simulation, self.speed_m_s = simulation, speed_m_s
        gravity = np.asarray(simulation.physics.gravity)
        self.gravity = float(np.linalg.norm(gravity))
        self.up = -gravity / (self.gravity or 1.0)
        floor = float(simulation.physics.floor_height)
        lower, upper = simulation.lower.copy(), np.array([*simulation.upper[:2], top_m])
        lower[2] = min(lower[2], floor if math.isfinite(floor) else math.inf)
        self.lowest_m, highest_m = np.sort(self.up * [lower, upper], axis=0).sum(axis=1)
        self.fall_m = float(highest_m - self.lowest_m)
        self.fastest_m_s = FASTEST * (
            math.sqrt(2.0 * self.gravity * self.fall_m) + speed_m_s
        )
        self.thickness_m = 2.0 * min(
            float(shape.half_extents_m.min()) for shape in simulation.shapes.values()
        )
        self.looked = 0
        self.broken = ""

    @contextmanager
    def guard(self) -> Iterator[None]:
        """Look at the grains at the end of a block; end it where a bound is broken, with the reason in `broken`."""
        try:
            yield
            self.look()
        except Unstable as error:
            self.broken = str(error)

    def run_to(self, step: int) -> None:
        """Advance to a time step, unless it has passed; `Unstable` if a bound is broken on the way."""
        simulation = self.simulation
        while simulation.steps < step:
            try:
                simulation.run_steps(min(step, self.looked + EVERY) - simulation.steps)
            except RuntimeError as error:  # contacts without number
                raise Unstable(f"{error}, {self._when('time step')}") from None
            if simulation.steps >= self.looked + EVERY:
                self.look(everywhere=simulation.steps % (SELDOM * EVERY) == 0)

    def look(self, everywhere: bool = True) -> None:
        """Look at the grains: at speeds, and `everywhere` at energy and overlaps, which takes ten times as long."""
        self.looked = self.simulation.steps
        if not self.simulation.n_bodies:
            return
        self._look_at_speeds()
        if everywhere:
            self._look_at_energy()
            self._look_at_overlaps()

    def _look_at_speeds(self) -> None:
        """Refuse a position that is not finite, and a speed that no fall gives."""
        simulation = self.simulation
        squares = np.square(simulation.velocities).sum(axis=1)
        squares[
            ~np.isfinite(squares) | ~np.isfinite(simulation.positions).all(axis=1)
        ] = np.inf
        fastest = int(np.argmax(squares))
        speed = math.sqrt(squares[fastest])
        if speed > self.fastest_m_s:
            motion = (
                f"moves at {speed:.3g} m/s"
                if math.isfinite(speed)
                else "has no finite position or speed"
            )
            bound = f"none here can be faster than {self.fastest_m_s:.3g} m/s"
            raise Unstable(
                f"grain {fastest} {motion}, {self._when('time step')}; {bound}"
            )

    def _look_at_energy(self) -> None:
        """Refuse more energy than the grains were given."""
        simulation, there = self.simulation, self.simulation.present
        energies = simulation.kinetic_energies()[there]
        masses = simulation.masses_kg[there]
        heights = simulation.positions[there] @ self.up - self.lowest_m
        energy = float(energies.sum() + self.gravity * np.sum(masses * heights))
        allowed = float(masses.sum()) * (
            self.gravity * self.fall_m + 0.5 * self.speed_m_s**2
        )
        if energy > (1.0 + GAIN) * allowed:
            most = int(np.flatnonzero(there)[np.argmax(energies)])
            bound = f"all grains together have {energy:.3g} J and were given {allowed:.3g} J"
            raise Unstable(
                f"grain {most} has {energies.max():.3g} J, {self._when('time step')}; {bound}"
            )

    def _look_at_overlaps(self) -> None:
        """Refuse grains that pass through each other or through walls."""
        simulation = self.simulation
        pairs, overlaps = simulation.overlaps()
        scales = simulation.scales[pairs].min(axis=1)
        self._refuse_deepest(
            overlaps, scales, lambda k: f"grains {pairs[k, 0]} and {pairs[k, 1]}"
        )
        grains, walls, overlaps = simulation.wall_overlaps()
        scales, names = simulation.scales[grains], simulation.wall_set.names
        self._refuse_deepest(
            overlaps,
            scales,
            lambda k: f"grain {grains[k]} and the wall {names[walls[k]]!r}",
        )

    def _refuse_deepest(
        self, overlaps: np.ndarray, scales: np.ndarray, which: Callable[[int], str]
    ) -> None:
        """Refuse overlaps too deep for grains of these scales; which(k): names of the overlapping bodies."""
        if not len(overlaps):
            return
        share = overlaps / scales / self.thickness_m
        worst = int(np.argmax(share))
        if share[worst] > DEEPEST:
            found = f"{which(worst)} overlap by {1e3 * overlaps[worst]:.3g} mm, {self._when('modulus')}"
            raise Unstable(
                f"{found}; at most {100 * DEEPEST:g} % of the smallest extent is a contact"
            )

    def _when(self, cure: str) -> str:
        """Tell the time and the remedy."""
        return f"after {self.simulation.time_s:.3g} s: {CURE[cure].format(self.simulation.time_step_s)}"
