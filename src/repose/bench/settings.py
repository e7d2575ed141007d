"""Define the sections of the configuration that several bench tests share."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar, cast

from pydantic import Field

from repose.common.section import OF_OTHERS, Berries, OneOf, OrAuto, Section, Seeds
from repose.dem.laws import CONTACT_LAWS, ROLLING_LAWS
from repose.grain.settings import ShearModulus

if TYPE_CHECKING:
    from repose.measure.settings import MeasureSettings

S = TypeVar("S", bound=Section)


class SimulationSettings(Section):
    """The section `simulation`: time step, gravity and force laws."""

    time_step_s: OrAuto[Annotated[float, Field(ge=1.0e-7, le=1.0e-2)]] = Field(
        default=OF_OTHERS,
        description="time step of the integration; `auto`: 0.8 of the longest that is "
        "allowed",
        json_schema_extra={"source": "3.1: 2.9256e-5"},
    )
    gravity_m_s2: float = Field(
        ge=0.1,
        le=100,
        description="acceleration of gravity, along -z",
        json_schema_extra={"source": "3.1: 9.81"},
    )
    tension: Literal["keep", "release"] = Field(
        description="`keep`: the damped normal force may pull at the end of an impact; "
        "`release`: it may not",
        json_schema_extra={"source": "open"},
    )
    rest_energy_j: OrAuto[Annotated[float, Field(gt=0, le=1.0)]] = Field(
        default=OF_OTHERS,
        description="largest mean kinetic energy of a grain at rest; `auto`: 5.8e-6 m g d, "
        "with its mass and diameter",
    )
    contact_law: Annotated[str, OneOf(lambda: CONTACT_LAWS)] = Field(
        description="force law of a contact",
        json_schema_extra={"source": "3.1: `hertz_mindlin`"},
    )
    rolling_law: Annotated[str, OneOf(lambda: ROLLING_LAWS)] = Field(
        description="rolling resistance of a contact",
        json_schema_extra={"source": "3.1 names none"},
    )

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

    poisson_ratio: float = Field(
        ge=0,
        le=0.49,
        description="Poisson's ratio of all walls",
        json_schema_extra={"source": "Table 2: PVC"},
    )
    shear_modulus_pa: ShearModulus = Field(
        description="shear modulus of all walls",
        json_schema_extra={"source": "Table 2: PVC"},
    )


@dataclass(frozen=True)
class SceneSettings:
    """Typed sections of a configuration. Each is validated when it is first read.

    Attributes
    ----------
    config : mapping
        The configuration, with numbers in place of every ``auto``.
    made : dict
        The typed sections that have been read, by name.
    """

    config: Mapping[str, Any]
    made: dict[str, Section] = field(default_factory=dict, repr=False, compare=False)

    def section(self, name: str, model: type[S]) -> S:
        """Return a section as an instance of its model.

        Parameters
        ----------
        name : str
            Name of the section.
        model : type of Section
            Its model, which validates it.
        """
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
        """The kind of size distribution: ``none`` or ``measured``."""
        return str(self.config["berry"]["size_distribution"])

    @property
    def mm_per_pixel(self) -> float:
        """Scale of the pictures that are measured [mm]."""
        return float(self.config["measure"]["mm_per_pixel"])

    def measure_of(self, grain: Mapping[str, Any]) -> "MeasureSettings":
        """Make the settings of the measurement of a pile of these grains."""
        from repose.measure.settings import MeasureSettings

        return self.section("measure", MeasureSettings).for_grain(grain)

    def targets_of(self, bench_test: str) -> list[Mapping[str, Any]]:
        """List the targets of a bench test.

        Malformed entries are left out, because the check of the section `targets`
        reports them.
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

    berries: Berries = Field(
        description="number of grains",
        json_schema_extra={"source": "2.3: 500; drum 4.2.2: 900"},
    )
    rate_per_s: float = Field(
        ge=0.1,
        le=10000,
        description="grains made per second, as in the measurement",
        json_schema_extra={"source": "3.1: 30; drum 4.2.2: 500"},
    )
    seeds: Seeds = Field(
        description="runs of each sample; the response of the sample is their mean",
        json_schema_extra={"source": "open"},
    )


class Hopper(Poured):
    """Keys of a bench test with a funnel: inlet, cone, tube and rounded edges."""

    inlet_diameter_mm: float = Field(
        ge=1,
        le=5000,
        description="diameter of the funnel's inlet",
        json_schema_extra={"source": "2.3: 150"},
    )
    outlet_diameter_mm: float = Field(
        ge=1,
        le=5000,
        description="diameter of the funnel's outlet: smaller than the inlet, larger "
        "than the grain's minor axis",
        json_schema_extra={"source": "2.3: 32"},
    )
    cone_angle_deg: float = Field(
        ge=5,
        le=89,
        description="angle of the funnel's wall, from the horizontal",
        json_schema_extra={"source": "open"},
    )
    tube_length_mm: float = Field(
        ge=0,
        le=1000,
        description="length of the straight tube below the cone",
        json_schema_extra={"source": "open"},
    )
    rim_radius_mm: float = Field(
        ge=0.05,
        le=20,
        description="rounding of the outlet's edge",
        json_schema_extra={"source": "open"},
    )


class Rotating(Poured):
    """Keys of a bench test with a drum that is filled and turns."""

    rotate_from_s: float = Field(
        ge=0.1,
        le=600,
        description="time from the start of the filling to the start of the rotation; "
        "later if the bed moves",
        json_schema_extra={"source": "4.2.2: 2 s of filling, 2.6 s of rest"},
    )
    angular_velocity_rad_s: float = Field(
        ge=1.0e-4,
        le=10,
        description="angular velocity of the drum and its caps",
        json_schema_extra={"source": "4.2.2: 0.0873"},
    )
    outer_diameter_mm: float = Field(
        ge=20,
        le=5000,
        description="outer diameter of the drum",
        json_schema_extra={"source": "4.2.2: 200"},
    )
    wall_thickness_mm: float = Field(
        gt=0,
        le=1000,
        description="thickness of the drum's wall",
        json_schema_extra={"source": "4.2.2: 5"},
    )
    length_mm: float = Field(
        ge=10,
        le=5000,
        description="length between the caps",
        json_schema_extra={"source": "4.2.2: 340"},
    )
    factory_height_mm: float = Field(
        ge=-2000,
        le=2000,
        description="height above the axis at which grains appear, inside the drum",
        json_schema_extra={"source": "open"},
    )
    record_s: float = Field(
        ge=0.001,
        le=10,
        description="interval of the record",
    )
    fit_share: float = Field(
        ge=0.1,
        le=1,
        description="the line is fitted to this middle part of the surface's width",
        json_schema_extra={"source": "open"},
    )
