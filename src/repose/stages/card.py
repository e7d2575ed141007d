"""The material card: the answer of a calibration as one file, for people and for other programs.

A card is made, written and read here, and compared with the configuration of its study. `card_model` defines its
content, `card_text` prints it.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from repose.bench import bench, reach
from repose.bench.parameters import LABELS
from repose.bench.settings import SimulationSettings, WallSettings
from repose.calibrate.answer import Result
from repose.calibrate.card import assembled
from repose.calibrate.card import held as held
from repose.calibrate.card import with_remark as with_remark
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.profiles import OfProfile
from repose.calibrate.responses import Response, derived
from repose.calibrate.runs import error_of
from repose.calibrate.targets import Targets
from repose.common.errors import InputError
from repose.common.files import Path_, read_json, read_table, write_json
from repose.common.section import Section
from repose.grain.berry_files import SIZE_COLUMNS, read_berry
from repose.grain.settings import GrainSettings
from repose.measure.section import MeasureSection
from repose.stages.card_model import WHAT, check

if TYPE_CHECKING:
    import pandas as pd

    from repose.grain.particle import Particle

    Tables = tuple[pd.DataFrame, pd.DataFrame]  # posterior.csv and draws.csv

GRAIN = ("density_kg_m3", "elastic_modulus_pa", "shear_modulus_pa", "poisson_ratio")
WALL = ("shear_modulus_pa", "poisson_ratio")
SIMULATION = ("time_step_s", "gravity_m_s2")
CHOSEN = "measure.response"  # names the definition of a response that has several
BERRY_HEIGHT = "berry_height_mm"
CONFIG = "config.json"  # the configuration of a study, beside its card
AGREEMENT = 1e-6  # relative, of a number of the card and of the configuration


class CardTarget(Protocol):
    """A target of the configuration, as a card describes it."""

    @property
    def response(self) -> str: ...

    @property
    def profile(self) -> OfProfile | None: ...


class CardSettings(Protocol):
    """The sections of the configuration that a card describes."""

    @property
    def label(self) -> str: ...

    @property
    def berry(self) -> GrainSettings: ...

    @property
    def wall(self) -> WallSettings: ...

    @property
    def simulation(self) -> SimulationSettings: ...

    @property
    def measure(self) -> MeasureSection: ...

    @property
    def targets(self) -> Sequence[CardTarget]: ...


class CardStudy(Protocol):
    """The configuration of a study, as a card describes it."""

    @property
    def config(self) -> dict[str, Any]: ...

    @property
    def settings(self) -> CardSettings: ...

    @property
    def parameters(self) -> ParameterSpace: ...

    @property
    def targets(self) -> Targets: ...


# --- made -----------------------------------------------------------------------------------------


def make(
    study: CardStudy,
    answer: Result,
    grain: Mapping[str, Any],
    particle: "Particle",
    feasible: "pd.DataFrame",
    posterior: "Tables | None" = None,
    dataset_csv: Path_ | None = None,
    row: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Make the card of a calibration; without a posterior, intervals and correlations come from the sets found.

    `dataset_csv` are the samples of the design. `row` is the answer's in table4.csv, which has its piles by every
    definition of the angle.
    """
    settings = study.settings
    about = {
        "grain": _grain(settings.berry.size_distribution == "none", grain, particle),
        "wall": {key: getattr(settings.wall, key) for key in WALL},
        "laws": laws(settings.simulation),
        "simulation": {key: getattr(settings.simulation, key) for key in SIMULATION},
    }
    tests = {
        target.name: described(study, target.response, grain)
        | _lines(settings.measure, target.name, row or {})
        for target in study.targets
    }
    for name, found in reach.of(study.config, particle, dataset_csv).items():
        tests[name]["reach"] = found.record()
    return assembled(
        about, tests, answer, study.parameters, feasible, posterior, labels=LABELS
    )


def laws(settings: SimulationSettings) -> dict[str, str]:
    """Describe the contact laws of a study, by direction."""
    from repose.dem.laws import CONTACT_LAWS, ROLLING_LAWS
    from repose.dem.laws.law import COULOMB

    contact = CONTACT_LAWS[settings.contact_law]
    limit = contact.limits[COULOMB[settings.tension]]
    words = {**contact.words, **ROLLING_LAWS[settings.rolling_law].words}
    sentences = {
        direction: text.format(limit=limit) for direction, text in words.items()
    }
    return sentences | {"end of an impact": contact.ends[settings.tension]}


def described(
    study: CardStudy, response: Response, grain: Mapping[str, Any]
) -> dict[str, Any]:
    """Describe a response by its definition and its bench test's settings, with the units in the keys."""
    from repose.measure.settings import MeasureSettings

    test, measure = bench(response.apparatus), study.settings.measure
    section, others = study.config[test.name], ("seeds", *test.measured_by)
    profiles = (
        one.profile for one in study.settings.targets if one.response == response.name
    )
    profile = next(profiles, None)
    if CHOSEN in response.definition:
        own = {other.name: other for other in test.responses}
        response = own.get(derived(response.name, measure.response), response)
    settings = {
        key.rpartition(".")[2]: value
        for key, value in response.settings(study.config).items()
    }
    if BERRY_HEIGHT in settings:
        height = MeasureSettings.of(dict(measure), grain).berry_height_mm
        settings[BERRY_HEIGHT] = None if height is None else float(f"{height:.6g}")
    if profile is not None:
        settings["profile"] = {
            "x": list(profile.x),
            "functions": profile.functions,
            "covered": profile.covered,
        }
    return {
        "definition": {"name": response.label, "settings": settings},
        "bench": {
            key: section[key]
            for key in test.settings.model_fields
            if key in section and key not in others
        },
    }


def _lines(measure: Section, name: str, row: Mapping[str, Any]) -> dict[str, Any]:
    """Describe the line of an angle of a pile, and the piles by every definition; nothing for another response."""
    from repose.measure.angles import MEAN_KEYS
    from repose.measure.settings import line_for, line_of

    line = line_for(measure, name)
    found: dict[str, dict[str, Any]] = {}
    if not line or not set(MEAN_KEYS.values()) <= set(row):
        return {"line": line} if line else {}
    for definition, column in MEAN_KEYS.items():
        numbers = {"simulated": row[column], "standard_error": row[error_of(column)]}
        found[definition] = {"line": line_of(measure, definition)}
        found[definition] |= {
            key: None if math.isnan(value) else float(value)
            for key, value in numbers.items()
        }
    return {"line": line, "definitions": found}


def _grain(
    alike: bool, grain: Mapping[str, Any], particle: "Particle"
) -> dict[str, Any]:
    """Describe the grain as simulated; `alike` where all have the mean size."""
    return {
        "mean_axes_mm": [grain[key] for key in SIZE_COLUMNS],
        "measured": int(grain["n"]),
        "relative_spread": 0.0 if alike else float(grain["scale_sd"]),
        **{key: grain[key] for key in GRAIN},
        "shape": particle.kind,
        "volume_mm3": _rounded(1e9 * particle.volume_m3),
        "mass_g": _rounded(1e3 * particle.mass_kg),
        "inertia_kg_m2": [_rounded(float(x)) for x in particle.inertia_kg_m2],
        "ellipsoids_mm": [
            [_rounded(1e3 * x) for x in row] for row in particle.semi_axes_m
        ],
        "spheres_mm": [[_rounded(1e3 * x) for x in row] for row in particle.spheres_m],
    }


def _rounded(value: float) -> float:
    """Round to six digits; more are not measured."""
    return float(f"{value:.6g}")


# --- written and read -----------------------------------------------------------------------------


def run(
    study: CardStudy, answer: Result, files: Mapping[str, Any], out: Path_
) -> dict[str, Any]:
    """Write the card of a finished calibration (`make`) and return it; optional ones of the files may be None."""
    from repose.grain.particle import Particle

    needed = (
        *SIZE_COLUMNS,
        "density_kg_m3",
        "elastic_modulus_pa",
        "shear_modulus_pa",
        "n",
    )
    grain = read_berry(files["berry"], needed)
    particle = Particle.load(files["particle"])
    feasible = read_table(files["feasible"], study.parameters.names)
    posterior = row = None
    if files["posterior"] is not None:
        intervals = read_table(
            files["posterior"], ("parameter", "credible_low", "credible_high")
        )
        posterior = (intervals, read_table(files["draws"], study.parameters.free))
    if files["table4"] is not None:
        rows = read_table(files["table4"], ("role",))
        row = rows[rows["role"] == "representative"].iloc[0].to_dict()
    card = make(
        study, answer, grain, particle, feasible, posterior, files["dataset"], row
    )
    check(card, out)
    write_json(out, card, indent=1)
    return card


def read(path: Path_) -> dict[str, Any]:
    """Read a card; raise InputError if the file cannot be read or is not a card."""
    card = read_json(path, (), WHAT)
    check(card, path)
    return card


# --- of one study ---------------------------------------------------------------------------------


def read_own(card_json: Path_) -> dict[str, Any]:
    """Read the card of a study that this program simulated; the card of another simulator raises InputError."""
    card = read(card_json)
    if "simulator" in card:
        raise InputError(
            card_json,
            "simulator",
            card["simulator"],
            "the card of a study that repose simulated",
        )
    return card


def configuration_of_card(card_json: Path_) -> Path | None:
    """Find the configuration that a run wrote next to its card; None if there is none."""
    path = Path(card_json).with_name(CONFIG)
    return path if path.is_file() else None


def require_one_study(
    card: Mapping[str, Any],
    card_json: Path_,
    study: CardStudy,
    source: Path_,
    grain: Mapping[str, Any],
) -> None:
    """Raise InputError if card and configuration differ in label, grain, wall, contact laws or a bench test."""
    settings = study.settings
    expected = {
        "material": settings.label,
        "grain.mean_axes_mm": [grain[key] for key in SIZE_COLUMNS],
    }
    expected |= {f"grain.{key}": grain[key] for key in GRAIN}
    expected |= {f"wall.{key}": getattr(settings.wall, key) for key in WALL}
    expected |= {f"laws.{key}": law for key, law in laws(settings.simulation).items()}
    mine = {"material": card["material"]}
    mine |= {
        f"{part}.{key}": value
        for part in ("grain", "wall", "laws")
        for key, value in card[part].items()
    }
    for test in card["tests"]:
        name = test["apparatus"]
        section = study.config.get(name, {})
        mine |= {f"{name}.{key}": value for key, value in test["bench"].items()}
        expected |= {f"{name}.{key}": section.get(key) for key in test["bench"]}
    unlike = [key for key, value in expected.items() if not _same(mine.get(key), value)]
    if unlike:
        allowed = f"{expected[unlike[0]]}, as in {source}: card and configuration of one study"
        others = f"; other differences: {', '.join(unlike[1:])}" if unlike[1:] else ""
        raise InputError(card_json, unlike[0], mine.get(unlike[0]), allowed + others)


def _same(first: object, second: object) -> bool:
    """Tell whether two values are the same; numbers to the precision of a file."""
    if isinstance(first, list) and isinstance(second, list):
        return len(first) == len(second) and all(map(_same, first, second))
    if isinstance(first, int | float) and isinstance(second, int | float):
        return math.isclose(first, second, rel_tol=AGREEMENT)
    return first == second
