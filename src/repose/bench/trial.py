"""Run the simulation of a bench test, with its grain sizes, checks and frames."""

from collections.abc import Callable

import numpy as np

from repose import dem
from repose.bench.bounds import Bounded
from repose.bench.scene import Scene

Progress = Callable[[float], object]
Build = Callable[[Scene, float], "dem.Simulation"]


class Trial:
    """The simulation of one run, with its grain sizes, its limits and its frames.

    Parameters
    ----------
    build : function
        ``build(scene, largest_scale)`` is called once to make the empty simulation. The
        simulation must have room for grains up to the relative size `largest_scale`.
    scene : Scene
        Settings, parameters, grain and seed of the run. The seed determines the sizes
        of the grains.
    n_grains : int
        Number of grains whose sizes are drawn.
    interval_s : float, optional
        Simulated time between two frames of a film. Without it no frames are recorded.
    progress : function, optional
        Called with the simulated time [s] whenever the simulation has advanced.

    Attributes
    ----------
    simulation : repose.dem.Simulation
        The simulation of the engine. Its settings are `scene.simulation`.
    scales : array
        Relative sizes (N,) of the grains, in the order in which they are added.
    largest_radius_m : float
        Bounding radius of the largest grain that can be drawn.
    bounds : Bounded
        Runs the simulation and checks its grains on the way. The method `bound` sets
        it, and must be called before the first time step.
    """

    bounds: Bounded

    def __init__(
        self,
        build: Build,
        scene: Scene,
        n_grains: int,
        interval_s: float | None = None,
        progress: Progress | None = None,
    ) -> None:
        """Draw the sizes of the grains, and build the empty simulation.

        The class documents the parameters. The interval between two frames is rounded
        to whole time steps.
        """
        from repose.grain.size_distribution import draw_scales

        self.scene = scene
        self.progress = progress
        self.scales, largest_scale = draw_scales(
            scene.settings.size_distribution, scene.grain, scene.seed, n_grains
        )
        self.largest_radius_m = largest_scale * scene.particle.bounding_radius_m
        self.simulation = build(scene, largest_scale)
        # Without an interval there is no recorder.
        self._recorder: dem.Recorder | None = None
        self._steps_per_frame = 1
        if interval_s is not None:
            self._recorder = dem.Recorder()
            steps_per_frame = round(interval_s / self.simulation.time_step_s)
            self._steps_per_frame = max(1, steps_per_frame)

    def bound(self, top_m: float, speed_m_s: float = 0.0) -> Bounded:
        """Compute the limits of the run, set the attribute `bounds`, and return it.

        Parameters
        ----------
        top_m : float
            Largest height [m] at which a grain is added or to which it is lifted.
        speed_m_s : float, optional
            Largest speed that a grain or a wall is given.
        """
        self.bounds = Bounded(self.simulation, top_m, speed_m_s)
        return self.bounds

    @property
    def broken(self) -> str:
        """Message about the limit that the run exceeded; empty if it exceeded none."""
        return self.bounds.broken

    @property
    def overlap_share(self) -> float:
        """Largest overlap at the last check, over the smallest extent of the grain."""
        return self.bounds.overlap_share

    def run_to(self, step: int) -> None:
        """Advance to a time step, and record the frames on the way.

        Nothing is computed if the simulation has reached the step already.

        Parameters
        ----------
        step : int
            The time step, counted from the beginning of the simulation.

        Raises
        ------
        repose.bench.bounds.Unstable
            If a limit is exceeded.
        """
        if self._recorder is None:
            self.bounds.run_to(step)
        else:
            self._run_and_record(step, self._recorder)
        if self.progress is not None:
            self.progress(self.simulation.time_s)

    def _run_and_record(self, last_step: int, recorder: "dem.Recorder") -> None:
        """Advance to a time step, and record the frames on the way.

        A frame is recorded at each multiple of `_steps_per_frame` that is reached. The
        state in which the call begins is not recorded.

        Parameters
        ----------
        last_step : int
            The time step, counted from the beginning of the simulation.
        recorder : repose.dem.Recorder
            The recorder, which keeps the frames. Calling it adds one.
        """
        step = self.simulation.steps
        while step < last_step:
            # Index of the last frame at or before this step
            n_frames = step // self._steps_per_frame
            next_frame_step = (n_frames + 1) * self._steps_per_frame
            step = min(last_step, next_frame_step)
            # `bounds` runs the simulation, and checks its grains on the way.
            self.bounds.run_to(step)
            if step == next_frame_step:
                recorder(self.simulation)

    def wait(
        self, condition: Callable[[], bool], last_step: int, check_interval: int
    ) -> None:
        """Advance until a condition is true, at most to a last time step.

        Parameters
        ----------
        condition : function
            ``condition()`` returns whether the condition is true.
        last_step : int
            The last time step, counted from the beginning of the simulation.
        check_interval : int
            Time steps between two checks. The first check is made at once.
        """
        while not condition() and self.simulation.steps < last_step:
            next_check = self.simulation.steps + check_interval
            self.run_to(min(last_step, next_check))

    def frames(self, walls: bool = False) -> dict[str, np.ndarray] | None:
        """Collect the frames of the film.

        Parameters
        ----------
        walls : bool, optional
            Whether to include the positions of the walls, which moving walls need.

        Returns
        -------
        dict or None
            ``scale`` (N,), ``time_s`` (T,), ``position`` (T, N, 3) [m] and
            ``quaternion`` (T, N, 4), where N is the capacity of the simulation. Values
            of grains that do not exist yet are NaN. With `walls` there are also
            ``planes`` and ``wall_frames`` of `repose.dem.Recorder.frames`. None if no
            frames were requested.
        """
        if self._recorder is None:
            return None
        recorded = self._recorder.frames()
        # Append grains that were never added, so that all frames have N grains.
        n_missing = self.simulation.capacity - len(recorded["scale"])
        scale = np.pad(recorded["scale"], (0, n_missing), constant_values=1.0)
        # Positions (T, N, 3) and quaternions (T, N, 4) are extended along the axis of
        # the grains, which is the second one.
        padding = ((0, 0), (0, n_missing), (0, 0))
        position = np.pad(recorded["position"], padding, constant_values=np.nan)
        quaternion = np.pad(recorded["quaternion"], padding, constant_values=np.nan)
        frames = {
            "scale": scale,
            "time_s": recorded["time_s"],
            "position": position,
            "quaternion": quaternion,
        }
        if walls:
            frames["planes"] = recorded["planes"]
            frames["wall_frames"] = recorded["wall_frames"]
        return frames

    def energy_j(self) -> float:
        """Compute the mean kinetic energy of a grain [J]."""
        return float(self.simulation.kinetic_energies().mean())

    def is_at_rest(self) -> bool:
        """Return whether the grains are at rest on average.

        If the energy is NaN, the grains count as at rest, so that a wait for rest ends.
        The status of the run then names the problem.
        """
        # Any comparison with NaN is false, so this is not the same as `<=`.
        return not self.energy_j() > self.scene.simulation.rest_energy_j

    def grains(self, **others: np.ndarray) -> dict[str, np.ndarray]:
        """Copy the present state of the grains to arrays, see `grain_arrays`.

        Parameters
        ----------
        **others : array
            Further arrays by name.
        """
        simulation = self.simulation
        return grain_arrays(
            simulation.positions, simulation.quaternions, simulation.scales, **others
        )


def grain_arrays(
    position: np.ndarray,
    quaternion: np.ndarray,
    scale: np.ndarray,
    **others: np.ndarray,
) -> dict[str, np.ndarray]:
    """Collect the arrays of a run with N grains.

    Parameters
    ----------
    position, quaternion, scale : array
        Positions (N, 3) [m], orientations (N, 4) and relative sizes (N,). They are
        converted to single precision, which resolves 0.03 um at the edge of a plate.
    **others : array
        Further arrays by name, which are not converted.
    """
    return {
        "position": position.astype(np.float32),
        "quaternion": quaternion.astype(np.float32),
        **others,
        "scale": scale.astype(np.float32),
    }
