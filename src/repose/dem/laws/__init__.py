"""Force laws by name. A new law is a file of this folder and its `LAW` in one of the two lists below."""

from . import (
    constant_torque,
    epsd,
    epsd2,
    hertz_mindlin,
    hertz_mindlin_rescaled,
    jkr,
    linear_spring,
    rolling,
    sjkr,
)
from .law import COULOMB, FRICTION_LIMITS, TENSIONS, Law, contact_forces, rolling_resistance

__all__ = [
    "CONTACT_LAWS",
    "COULOMB",
    "FRICTION_LIMITS",
    "ROLLING_LAWS",
    "TENSIONS",
    "Law",
    "contact_forces",
    "rolling_resistance",
]

CONTACT_LAWS: dict[str, Law] = {
    law.name: law
    for law in (hertz_mindlin.LAW, hertz_mindlin_rescaled.LAW, linear_spring.LAW, jkr.LAW, sjkr.LAW)
}
ROLLING_LAWS: dict[str, Law] = {
    law.name: law for law in (rolling.LAW, constant_torque.LAW, epsd.LAW, epsd2.LAW)
}
