"""What all bench tests share: the configuration's section ``simulation``."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class SimulationSettings:
    """Settings of every simulation of a study.

    Attributes
    ----------
    time_step_s : float
        Length of a time step [s].
    gravity_m_s2 : float
        Acceleration along -z [m/s2].
    tension : str
        How the normal force ends an impact; see `repose.dem.Simulation`.
    friction_limit : str
        Which normal force limits friction and rolling resistance; see `repose.dem.Simulation`.
    rest_energy_j : float
        A bed is at rest when its mean kinetic energy of a berry is below this [J].
    contact_law : str
        Name of the contact law, one of `repose.dem.laws.CONTACT_LAWS`; the configuration need not name it.
    """

    time_step_s: float
    gravity_m_s2: float
    tension: str
    friction_limit: str
    rest_energy_j: float
    contact_law: str = "hertz_mindlin"

    @classmethod
    def of(cls, config: Mapping[str, Any]) -> "SimulationSettings":
        """Settings of a configuration.

        Parameters
        ----------
        config : mapping
            The whole configuration.

        Returns
        -------
        SimulationSettings
        """
        return cls(**config["simulation"])

    def steps(self, seconds: float) -> int:
        """Number of time steps of a duration, to the nearest one.

        Parameters
        ----------
        seconds : float

        Returns
        -------
        int
        """
        return round(seconds / self.time_step_s)
