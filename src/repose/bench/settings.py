"""Sections of the configuration that several bench tests share: `simulation`, `wall`, and base classes."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar, cast

from pydantic import Field

from repose.common.section import OF_OTHERS, Berries, OneOf, OrAuto, Section, Seeds
from repose.dem.laws import CONTACT_LAWS, ROLLING_LAWS

if TYPE_CHECKING:
    from repose.measure.settings import MeasureSettings

S = TypeVar("S", bound=Section)
# Rolling laws under which a body creeps as long as a torque acts on it.
CREEPING_LAWS = ("constant_torque",)


class SimulationSettings(Section):
    """The section `simulation`: time step, gravity and force laws of every simulation."""

    time_step_s: OrAuto[Annotated[float, Field(ge=1.0e-7, le=1.0e-2)]] = OF_OTHERS
    # Gravity acts along -z.
    gravity_m_s2: float = Field(ge=0.1, le=100)
    # Whether the normal force may pull at the end of an impact.
    tension: Literal["keep", "release"]
    # The largest mean kinetic energy of a grain in a bed at rest.
    rest_energy_j: OrAuto[Annotated[float, Field(gt=0, le=1.0)]] = OF_OTHERS
    contact_law: Annotated[str, OneOf(lambda: CONTACT_LAWS)]
    rolling_law: Annotated[str, OneOf(lambda: ROLLING_LAWS)]

    @property
    def laws(self) -> dict[str, Any]:
        """The force laws, as arguments of `repose.dem.Simulation`."""
        return {
            "tension": self.tension,
            "contact_law": self.contact_law,
            "rolling_law": self.rolling_law,
        }

    def steps(self, seconds: float) -> int:
        """Convert a duration to the nearest whole number of time steps."""
        return round(seconds / self.time_step_s)


class WallSettings(Section):
    """The section `wall`: the material of all walls."""

    poisson_ratio: float = Field(ge=0, le=0.49)
    shear_modulus_pa: float = Field(ge=1.0e3, le=1.0e12)


@dataclass(frozen=True)
class SceneSettings:
    """Typed sections of a configuration; a section is validated when it is first read.

    Attributes
    ----------
    config : mapping
        The configuration, with numbers in place of every ``auto``.
    made : dict
        Typed sections by name, filled on demand.
    """

    config: Mapping[str, Any]
    made: dict[str, Section] = field(default_factory=dict, repr=False, compare=False)

    def section(self, name: str, model: type[S]) -> S:
        """Return the section of this name as an instance of its model."""
        if name not in self.made:
            self.made[name] = model.model_validate(self.config[name])
        return cast(S, self.made[name])

    @property
    def simulation(self) -> SimulationSettings:
        """The section `simulation`."""
        return self.section("simulation", SimulationSettings)

    @property
    def wall(self) -> WallSettings:
        """The section `wall`."""
        return self.section("wall", WallSettings)

    @property
    def size_distribution(self) -> str:
        """How the sizes of grains are distributed: ``none`` or ``measured``."""
        return str(self.config["berry"]["size_distribution"])

    @property
    def mm_per_pixel(self) -> float:
        """Scale of the pictures that are measured [mm]."""
        return float(self.config["measure"]["mm_per_pixel"])

    def measure_of(self, grain: Mapping[str, Any]) -> "MeasureSettings":
        """Make the settings of the measurement of a pile of these grains."""
        from repose.measure.settings import MeasureSettings

        return MeasureSettings.of(self.config["measure"], grain)

    def targets_of(self, bench_test: str) -> list[Mapping[str, Any]]:
        """Select the targets of a bench test.

        Malformed entries are skipped: the check of the section `targets` reports them.
        """
        targets = self.config.get("targets")
        if not isinstance(targets, list | tuple):
            return []
        return [
            target
            for target in targets
            if isinstance(target, Mapping) and target.get("apparatus") == bench_test
        ]


class Poured(Section):
    """Keys of a bench test whose grains are added one by one."""

    berries: Berries
    rate_per_s: float = Field(ge=0.1, le=10000)
    seeds: Seeds


class Hopper(Poured):
    """Keys of a bench test with a funnel: inlet, cone, tube and rounded edges."""

    inlet_diameter_mm: float = Field(ge=1, le=5000)
    outlet_diameter_mm: float = Field(ge=1, le=5000)
    cone_angle_deg: float = Field(ge=5, le=89)
    tube_length_mm: float = Field(ge=0, le=1000)
    rim_radius_mm: float = Field(ge=0.05, le=20)


class Rotating(Poured):
    """Keys of a bench test with a drum that is filled and turns."""

    rotate_from_s: float = Field(ge=0.1, le=600)
    angular_velocity_rad_s: float = Field(ge=1.0e-4, le=10)
    outer_diameter_mm: float = Field(ge=20, le=5000)
    wall_thickness_mm: float = Field(gt=0, le=1000)
    length_mm: float = Field(ge=10, le=5000)
    factory_height_mm: float = Field(ge=-2000, le=2000)
    record_s: float = Field(ge=0.001, le=10)
    fit_share: float = Field(ge=0.1, le=1)
