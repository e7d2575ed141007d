"""Force laws by name. A new law is a file of this folder and its `LAW` in one of the two lists below."""

from . import hertz_mindlin, linear_spring, rolling
from .law import FRICTION_LIMITS, TENSIONS, Law, contact_forces, rolling_resistance

__all__ = [
    "CONTACT_LAWS",
    "FRICTION_LIMITS",
    "ROLLING_LAWS",
    "TENSIONS",
    "Law",
    "contact_forces",
    "rolling_resistance",
]

CONTACT_LAWS: dict[str, Law] = {law.name: law for law in (hertz_mindlin.LAW, linear_spring.LAW)}
ROLLING_LAWS: dict[str, Law] = {law.name: law for law in (rolling.LAW,)}
