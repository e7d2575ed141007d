"""Settings shared by bench tests: the section ``simulation`` of the configuration, and keys of several sections."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pydantic import Field

from repose.core.section import Berries, Section, Seeds


@dataclass(frozen=True)
class SimulationSettings:
    """Settings of every simulation of a study."""

    time_step_s: float
    gravity_m_s2: float  # along -z
    tension: str  # how the normal force ends an impact; see `repose.dem.Simulation`
    rest_energy_j: float  # a bed is at rest when its mean kinetic energy of a berry is below this
    contact_law: str = "hertz_mindlin"  # a name of `repose.dem.laws.CONTACT_LAWS`
    rolling_law: str = "budget"  # a name of `repose.dem.laws.ROLLING_LAWS`
    # No key of a configuration: for comparisons with programs whose limit does not go with their tension.
    friction_limit: str | None = None

    @classmethod
    def of(cls, config: Mapping[str, Any]) -> "SimulationSettings":
        """Settings of a configuration."""
        return cls(**config["simulation"])

    @property
    def laws(self) -> dict[str, Any]:
        """The force laws, as `repose.dem.Simulation` takes them."""
        laws = {"tension": self.tension, "contact_law": self.contact_law, "rolling_law": self.rolling_law}
        return laws if self.friction_limit is None else laws | {"friction_limit": self.friction_limit}

    def not_at_rest(self, energy_j: float, when: str = "") -> tuple[str, str]:
        """Status and reason of a run that ends with this mean energy of a berry; when: further words."""
        moves = f"kinetic energy {energy_j:.2e} J a berry{when}"
        return "not_at_rest", f"{moves}, more than {self.rest_energy_j:.0e}"

    def steps(self, seconds: float) -> int:
        """Number of time steps of a duration, to the nearest one."""
        return round(seconds / self.time_step_s)


class Poured(Section):
    """Keys of a bench test whose berries are poured at a rate."""

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
