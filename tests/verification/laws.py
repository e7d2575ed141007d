"""The force laws with which the cases run: keywords of `Simulation`."""

from pathlib import Path

import pytest
import yaml

from repose.bench.settings import SimulationSettings

METHOD = Path(__file__).parents[2] / "config" / "method.yaml"


def default_laws():
    """Read the laws of a study that names none of its own."""
    settings = yaml.safe_load(METHOD.read_text(encoding="utf-8"))["simulation"]
    settings["time_step_s"] = 1e-4  # the file leaves it to the program
    return SimulationSettings.model_validate(settings).laws


# "keep" are those of config/paper.yaml: a contact may pull at its end, friction is
# limited by the elastic force, and the tangential spring follows the present stiffness.
LAWS = {
    "default": default_laws(),
    "keep": {
        "tension": "keep",
        "contact_law": "hertz_mindlin",
        "rolling_law": "budget",
    },
}

# Marks a case of few hits, which is cheap enough to run with all laws.
with_all_laws = pytest.mark.parametrize("laws", LAWS, indirect=True)
