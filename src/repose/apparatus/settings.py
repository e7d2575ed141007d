"""Settings shared by all bench tests: the section ``simulation`` of the configuration."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


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

    def steps(self, seconds: float) -> int:
        """Number of time steps of a duration, to the nearest one."""
        return round(seconds / self.time_step_s)
