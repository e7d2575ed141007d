"""Settings shared by bench tests: the section ``simulation`` of the configuration, and keys of several sections."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

from pydantic import Field

from repose.common.section import OF_OTHERS, Berries, OneOf, OrAuto, Section, Seeds
from repose.dem.laws import CONTACT_LAWS, ROLLING_LAWS

if TYPE_CHECKING:
    from repose.measure.settings import MeasureSettings

S = TypeVar("S", bound=Section)
CREEPING_LAWS = (
    "constant_torque",
)  # rolling laws that hold no body still where a torque acts on it


class SimulationSettings(Section):
    """The section `simulation`: settings of every simulation of a study."""

    time_step_s: OrAuto[Annotated[float, Field(ge=1.0e-7, le=1.0e-2)]] = OF_OTHERS
    gravity_m_s2: float = Field(ge=0.1, le=100)  # along -z
    tension: Literal["keep", "release"]  # how the normal force ends an impact
    rest_energy_j: float = Field(
        gt=0, le=1.0e-3
    )  # a bed is at rest when its mean energy of a grain is below this
    contact_law: Annotated[str, OneOf(lambda: CONTACT_LAWS)]
    rolling_law: Annotated[str, OneOf(lambda: ROLLING_LAWS)]

    @property
    def laws(self) -> dict[str, Any]:
        """The force laws, as `repose.dem.Simulation` takes them."""
        return {
            "tension": self.tension,
            "contact_law": self.contact_law,
            "rolling_law": self.rolling_law,
        }

    def not_at_rest(self, energy_j: float, when: str = "") -> tuple[bool, str, str]:
        """Say whether a run of this mean energy of a grain is not at rest, and status and reason; when: more words."""
        moves = f"kinetic energy {energy_j:.2e} J a grain{when}"
        return (
            not energy_j <= self.rest_energy_j,
            "not_at_rest",
            f"{moves}, more than {self.rest_energy_j:.0e}",
        )

    def steps(self, seconds: float) -> int:
        """Count the time steps of a duration, to the nearest one."""
        return round(seconds / self.time_step_s)


class WallSettings(Section):
    """The section `wall`: the material of all walls."""

    poisson_ratio: float = Field(ge=0, le=0.49)
    shear_modulus_pa: float = Field(ge=1.0e3, le=1.0e12)


@dataclass(frozen=True)
class SceneSettings:
    """The sections of a configuration that a scene is made of, typed; each is made when it is first read."""

    config: Mapping[str, Any]
    made: dict[str, Section] = field(default_factory=dict, repr=False, compare=False)

    def section(self, name: str, model: type[S]) -> S:
        """Return the section of a bench test."""
        if name not in self.made:
            self.made[name] = model.model_validate(self.config[name])
        made: Any = self.made[name]
        return made

    @property
    def simulation(self) -> SimulationSettings:
        """Time step, gravity and force laws."""
        return self.section("simulation", SimulationSettings)

    @property
    def wall(self) -> WallSettings:
        """The material of all walls."""
        return self.section("wall", WallSettings)

    @property
    def size_distribution(self) -> str:
        """Whether grains have the sizes that were measured."""
        return str(self.config["berry"]["size_distribution"])

    @property
    def mm_per_pixel(self) -> float:
        """Scale of a silhouette; other keys of `measure` are a pile's."""
        return float(self.config["measure"]["mm_per_pixel"])

    def measure_of(self, grain: Mapping[str, Any]) -> "MeasureSettings":
        """Make the settings of the measurement of a pile of these grains."""
        from repose.measure.settings import MeasureSettings

        return MeasureSettings.of(self.config["measure"], grain)

    def targets_of(self, bench_test: str) -> list[Mapping[str, Any]]:
        """Targets of a bench test; targets whose form is wrong are left out, for their own check refuses them."""
        given = self.config.get("targets")
        listed = given if isinstance(given, list | tuple) else ()
        return [
            one
            for one in listed
            if isinstance(one, Mapping) and one.get("apparatus") == bench_test
        ]


class Poured(Section):
    """Keys of a bench test whose grains are poured at a rate."""

    berries: Berries
    rate_per_s: float = Field(ge=0.1, le=10000)
    seeds: Seeds


class Hopper(Poured):
    """Keys of a funnel: inlet, cone and tube."""

    inlet_diameter_mm: float = Field(ge=1, le=5000)
    outlet_diameter_mm: float = Field(ge=1, le=5000)
    cone_angle_deg: float = Field(ge=5, le=89)
    tube_length_mm: float = Field(ge=0, le=1000)
    rim_radius_mm: float = Field(ge=0.05, le=20)


class Rotating(Poured):
    """Keys of a drum that is filled and turns."""

    rotate_from_s: float = Field(ge=0.1, le=600)
    angular_velocity_rad_s: float = Field(ge=1.0e-4, le=10)
    outer_diameter_mm: float = Field(ge=20, le=5000)
    wall_thickness_mm: float = Field(gt=0, le=1000)
    length_mm: float = Field(ge=10, le=5000)
    factory_height_mm: float = Field(ge=-2000, le=2000)
    record_s: float = Field(ge=0.001, le=10)
    fit_share: float = Field(ge=0.1, le=1)
