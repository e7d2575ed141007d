"""The grain and the configurations that the tests of the bench tests share."""

from pathlib import Path

from repose.config.study import Study
from repose.core.parameters import PARAMETERS
from repose.particle.build import ellipsoid_mesh, fit_particle

ROOT = Path(__file__).parents[2]
AXES_MM = (21.14, 11.37, 9.88)
DENSITY_KG_M3 = 840.47
BERRY = {"shear_modulus_pa": 4.3e4, "poisson_ratio": 0.32, "density_kg_m3": DENSITY_KG_M3}


def particle(axes_mm=AXES_MM):
    """The ellipsoid of given axes."""
    return fit_particle(ellipsoid_mesh(axes_mm), DENSITY_KG_M3)


PARTICLE = particle()


def recommended(section, **keys):
    """The recommended configuration with some keys of a section changed."""
    whole = Study.load(ROOT / "config/config.yaml").config
    whole[section].update(keys)
    return whole


def named(values):
    """Six numbers as the parameters of a run."""
    return dict(zip(PARAMETERS, values, strict=True))
