"""Force laws by name. A new law is a file of this folder and its `LAW` in one of the two lists below."""

from . import epsd, hertz_mindlin, hertz_mindlin_rescaled, linear_spring, rolling
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
    law.name: law for law in (hertz_mindlin.LAW, hertz_mindlin_rescaled.LAW, linear_spring.LAW)
}
ROLLING_LAWS: dict[str, Law] = {law.name: law for law in (rolling.LAW, epsd.LAW)}
