"""Make the material card of a study, compare it with a study, or rebuild its grain."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from pydantic import ValidationError

from repose.bench import bench, reach
from repose.bench.funnel import FunnelSettings
from repose.bench.parameters import LABELS
from repose.bench.settings import SimulationSettings, WallSettings
from repose.calibrate.answer import Result
from repose.calibrate.card import assemble_card
from repose.calibrate.parameter_space import ParameterSpace
from repose.calibrate.profiles import ProfileSection
from repose.calibrate.responses import Response, name_derived_column
from repose.calibrate.runs import name_error_column
from repose.calibrate.samples_inside import find_samples_inside
from repose.calibrate.targets import Targets
from repose.common.errors import InputError, raise_together
from repose.common.files import StrPath, read_table, write_json
from repose.grain.berry_files import SIZE_COLUMNS, read_grain
from repose.grain.settings import GrainSettings
from repose.measure.settings import MeasureSettings
from repose.stages import card, published
from repose.stages.settings import SimulatorSettings

if TYPE_CHECKING:
    import pandas as pd

    from repose.calibrate.card import PosteriorTables
    from repose.grain.particle import Particle

GRAIN_KEYS = (
    "density_kg_m3",
    "elastic_modulus_pa",
    "shear_modulus_pa",
    "poisson_ratio",
)
WALL_KEYS = ("shear_modulus_pa", "poisson_ratio")
# Keys that the file of the mean grain must have.
GRAIN_COLUMNS = (
    *SIZE_COLUMNS,
    "density_kg_m3",
    "elastic_modulus_pa",
    "shear_modulus_pa",
    "n",
)
SIMULATION_KEYS = ("time_step_s", "gravity_m_s2")
GRAVITY_KEY = "simulation.gravity_m_s2"
# This key names the definition of a response that has several.
CHOSEN_DEFINITION_KEY = "measure.response"
GRAIN_HEIGHT_KEY = "berry_height_mm"
# Name of the configuration of a study, in the folder of its card.
CONFIG_FILE = "config.json"
# Relative difference up to which a number of a card equals one of a configuration.
RELATIVE_TOLERANCE = 1e-6
# The gravity of an export, if the card is from an earlier version, which does not state
# it.
DEFAULT_GRAVITY_M_S2 = 9.81
# The configuration requires this key, but exported input scripts do not detect rest.
REST_ENERGY_J = 1.0e-9
# Longer than any stable time step. The engine shortens it to the longest stable one.
UPPER_TIME_STEP_S = 1.0e-2
# A solid sphere has the moment of inertia 2/5 m r^2.
SPHERE_INERTIA_FACTOR = 0.4
# The mesh of a body from which a clump is made has this many rings, each with this many
# points.
MESH_RINGS = 48
MESH_POINTS_OF_RING = 96
# A smaller standard deviation of the sizes, as a fraction of their mean, is a rounding
# error.
SMALLEST_SPREAD = 1e-9


class CardTarget(Protocol):
    """A target of the configuration, as a card describes it."""

    @property
    def response(self) -> str: ...

    @property
    def profile(self) -> ProfileSection | None: ...


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
    def measure(self) -> MeasureSettings: ...

    @property
    def targets(self) -> Sequence[CardTarget]: ...


class CardStudy(Protocol):
    """The configuration of a study, as a card describes it."""

    @property
    def config(self) -> dict[str, Any]: ...

    @property
    def settings(self) -> CardSettings: ...

    @property
    def simulator(self) -> SimulatorSettings | None: ...

    @property
    def parameters(self) -> ParameterSpace: ...

    @property
    def targets(self) -> Targets: ...


# --- make a card ----------------------------------------------------------------------


def write_card(
    study: CardStudy, answer: Result, files: Mapping[str, Any], out: StrPath
) -> dict[str, Any]:
    """Make and write the material card of a finished calibration.

    A material card is a JSON file with everything that another user needs: the grain,
    the contact laws, the calibrated parameters, and the tests on which they are based.

    Parameters
    ----------
    study : CardStudy
        The study.
    answer : Result
        The calibrated parameter set, with the check that simulated it again.
    files : mapping of str to path
        The input files by name. ``feasible`` (all parameter sets that the search found)
        is always needed. ``posterior`` and ``table4`` must be present, but may be None.
        ``draws`` is needed if ``posterior`` is not None. If repose simulated the study,
        ``berry`` (the measured grains) and ``particle`` (the simulated grain) are
        needed, too. ``dataset`` must be present, but may be None. So must ``published``
        and ``published_simulated``: the published sets, and their simulations here.
    out : path
        The file to write.

    Returns
    -------
    dict
        The card.

    Raises
    ------
    InputError
        If a file cannot be read, or if the card would not be valid.
    """
    from repose.grain.particle import Particle

    feasible = read_table(files["feasible"], study.parameters.names)
    posterior = _read_posterior(files, study.parameters)
    answer_row = _read_answer_row(files["table4"])
    comparisons = _make_comparisons(study, files)
    if study.simulator is not None:
        content = make_external_card(
            study,
            answer,
            study.simulator.name,
            feasible,
            posterior=posterior,
            answer_row=answer_row,
            comparisons=comparisons,
        )
    else:
        content = make_card(
            study,
            answer,
            grain=read_grain(files["berry"], GRAIN_COLUMNS),
            particle=Particle.load(files["particle"]),
            feasible=feasible,
            posterior=posterior,
            dataset_csv=files["dataset"],
            answer_row=answer_row,
            comparisons=comparisons,
        )
    card.check_card(content, out)
    write_json(out, content, indent=1)
    return content


def _read_posterior(
    files: Mapping[str, Any], parameters: ParameterSpace
) -> "PosteriorTables | None":
    """Read intervals and draws of the posterior; None for a study without it.

    `files` has the paths ``posterior`` and ``draws``.
    """
    if files["posterior"] is None:
        return None
    columns = ("parameter", "credible_low", "credible_high")
    intervals = read_table(files["posterior"], columns)
    draws = read_table(files["draws"], parameters.free)
    return intervals, draws


def _read_answer_row(table4_csv: StrPath | None) -> dict[str, Any] | None:
    """Read the answer's row of table4.csv; None for a study without this table."""
    from repose.stages.tables import find_answer  # slow to import

    if table4_csv is None:
        return None
    table4 = read_table(table4_csv, ("role",))
    return find_answer(table4, source=table4_csv).to_dict()


def _make_comparisons(study: CardStudy, files: Mapping[str, Any]) -> dict[str, Any]:
    """Make the entries of the card with which the answer is compared.

    `files` has the paths ``dataset``, ``published`` and ``published_simulated``, or
    None for a file that the study lacks.
    """
    comparisons: dict[str, Any] = {}
    names = study.parameters.names
    if files["dataset"] is not None:
        samples = read_table(files["dataset"], (*names, *study.targets.names))
        comparisons["samples_inside"] = find_samples_inside(
            samples, study.parameters, study.targets
        )
    if files["published"] is not None:
        published_answer = read_published_answer(
            files["published"],
            files["published_simulated"],
            parameter_names=names,
            responses=study.targets.responses,
        )
        if published_answer is not None:
            comparisons["published"] = published_answer
    return comparisons


def read_published_answer(
    published_csv: StrPath,
    simulated_csv: StrPath | None,
    *,
    parameter_names: Sequence[str],
    responses: Iterable[Response],
) -> dict[str, Any] | None:
    """Read the set that a publication recommends, and its simulations here.

    Parameters
    ----------
    published_csv : path
        The published sets.
    simulated_csv : path or None
        Their simulations, a table of `repose.stages.validate.compare_with_published`,
        which may have no rows.
    parameter_names : sequence of str
        Parameters of the study.
    responses : iterable of Response
        Responses of the study.

    Returns
    -------
    dict or None
        The entry ``published`` of the card; None if no set is recommended.
    """
    sets = read_table(published_csv, ("solution", *parameter_names))
    row = _find_recommended_set(sets)
    if row is None:
        return None
    entry: dict[str, Any] = {}
    if isinstance(row.get("source"), str):
        entry["source"] = row["source"]
    entry["parameters"] = {name: float(row[name]) for name in parameter_names}
    if simulated_csv is None:
        return entry
    simulated = _find_recommended_set(read_table(simulated_csv, ("solution",)))
    if simulated is None:
        return entry

    means = {}
    for response in responses:
        mean = simulated.get(response.simulated)
        if mean is None or math.isnan(mean):
            continue
        error = float(simulated.get(response.standard_error, math.nan))
        means[response.name] = {
            "simulated": float(mean),
            "standard_error": None if math.isnan(error) else error,
        }
    if means:
        entry |= {"responses": means, "runs": int(simulated["n_seeds"])}
        if simulated["stale"]:
            entry["stale"] = True
    return entry


def _find_recommended_set(sets: "pd.DataFrame") -> dict[str, Any] | None:
    """Find the row of the set that a publication recommends, in a table of sets."""
    rows = sets[sets["solution"] == published.REPRESENTATIVE].to_dict("records")
    return rows[0] if rows else None


def make_card(
    study: CardStudy,
    answer: Result,
    grain: Mapping[str, Any],
    particle: "Particle",
    feasible: "pd.DataFrame",
    posterior: "PosteriorTables | None" = None,
    dataset_csv: StrPath | None = None,
    answer_row: Mapping[str, Any] | None = None,
    comparisons: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Make the material card of a calibration that repose simulated.

    Parameters
    ----------
    study : CardStudy
        The study.
    answer : Result
        The calibrated parameter set, with the check that simulated it again.
    grain : mapping
        The content of `berry.json`: the measured grains.
    particle : Particle
        The shape and mass of a simulated grain of mean size.
    feasible : pandas.DataFrame
        The parameter sets that the search found.
    posterior : PosteriorTables, optional
        Two tables: the intervals of the posterior, and draws from it.
    dataset_csv : path, optional
        The simulated samples of the study. Their piles help to judge whether piles of
        these grains can reach the angle of a target.
    answer_row : mapping, optional
        The row of the answer in table4.csv. If it has the angle of the answer's piles
        by every definition in `repose.measure.angles`, the card states all of them.
    comparisons : mapping, optional
        Entries of the card with which the answer is compared.

    Returns
    -------
    dict
        The card.
    """
    settings = study.settings
    # Without a distribution of sizes, all grains are simulated with the mean size.
    has_equal_grains = settings.berry.size_distribution == "none"
    # The subject is what was simulated, apart from the parameters.
    subject = {
        "grain": _describe_grain(has_equal_grains, grain, particle),
        "wall": {key: getattr(settings.wall, key) for key in WALL_KEYS},
        "laws": describe_laws(settings.simulation),
        "simulation": {
            key: getattr(settings.simulation, key) for key in SIMULATION_KEYS
        },
    }

    # Describe for each target how its response is measured.
    tests = {}
    for target in study.targets:
        tests[target.name] = {
            **describe_response(study, target.response, grain),
            **_describe_angles(settings.measure, target.name, answer_row or {}),
        }
    # For each target that is an angle of a pile, add whether piles of these grains can
    # have it at the height that another target demands. The names of the assessments
    # are names of targets.
    assessments = reach.assess_targets(study.config, particle, dataset_csv)
    for name, assessment in assessments.items():
        tests[name]["reach"] = assessment.record()

    return assemble_card(
        subject,
        tests,
        answer=answer,
        space=study.parameters,
        solutions=feasible,
        posterior=posterior,
        labels=LABELS,
        comparisons=comparisons,
    )


def make_external_card(
    study: CardStudy,
    answer: Result,
    simulator: str,
    feasible: "pd.DataFrame",
    posterior: "PosteriorTables | None" = None,
    answer_row: Mapping[str, Any] | None = None,
    comparisons: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Make the material card of a calibration that another program simulated.

    Only the user knows how that program defines a response. The card therefore repeats
    the words with which the configuration describes it.

    Parameters
    ----------
    study : CardStudy
        The study.
    answer : Result
        The calibrated parameter set, with the check that simulated it again.
    simulator : str
        Name of the program.
    feasible : pandas.DataFrame
        The parameter sets that the search found.
    posterior : PosteriorTables, optional
        Two tables: the intervals of the posterior, and draws from it.
    answer_row : mapping, optional
        The row of the answer in table4.csv. If it has the angle of the answer's piles
        by every definition in `repose.measure.angles`, the card states all of them.
    comparisons : mapping, optional
        Entries of the card with which the answer is compared.

    Returns
    -------
    dict
        The card.
    """
    measure = study.settings.measure
    definition_of_response = {
        entry["response"]: entry.get("definition") for entry in study.config["targets"]
    }
    tests = {}
    for name in study.targets.names:
        # The card of every study has these keys. The settings of another program are
        # unknown, so they stay empty.
        definition: dict[str, Any] = {
            "name": definition_of_response[name],
            "settings": {},
        }
        tests[name] = {"definition": definition, "bench": None}
        if measure is not None:
            tests[name] |= _describe_angles(measure, name, answer_row or {})
    return assemble_card(
        {"simulator": simulator},
        tests,
        answer=answer,
        space=study.parameters,
        solutions=feasible,
        posterior=posterior,
        comparisons=comparisons,
    )


def describe_laws(settings: SimulationSettings) -> dict[str, str]:
    """Describe the contact laws of a study, in a sentence for each part of a law.

    Parameters
    ----------
    settings : SimulationSettings
        It names the contact law, the law of rolling resistance, and in `tension` the
        rule for a contact whose damped normal force would pull.

    Returns
    -------
    dict
        The sentences. Their keys are the directions of the force, such as `normal`, and
        "end of an impact", whose sentence says when two grains separate.
    """
    from repose.dem.laws import CONTACT_LAWS, ROLLING_LAWS
    from repose.dem.laws.law import COULOMB

    contact_law = CONTACT_LAWS[settings.contact_law]
    rolling_law = ROLLING_LAWS[settings.rolling_law]

    # The sentences of a law contain `{limit}`, the name of the normal force that limits
    # friction. Which force this is depends on `tension`: `COULOMB` translates it into a
    # key of the law's texts `limits`.
    friction_limit = contact_law.limits[COULOMB[settings.tension]]
    templates = {**contact_law.words, **rolling_law.words}
    sentences = {}
    for direction, template in templates.items():
        sentences[direction] = template.format(limit=friction_limit)
    sentences["end of an impact"] = contact_law.ends[settings.tension]
    return sentences


def describe_response(
    study: CardStudy, response: Response, grain: Mapping[str, Any]
) -> dict[str, Any]:
    """Describe the definition of a response and the settings of its bench test.

    Parameters
    ----------
    study : CardStudy
        The study.
    response : Response
        The response of a target.
    grain : mapping
        The grain. If `berry_height_mm` is `auto`, it is computed from the grain's axes.

    Returns
    -------
    dict
        ``definition`` and ``bench``, with the units in the keys.
    """
    defined = _find_chosen_response(study, response)
    settings = _collect_definition_settings(study, defined, grain)
    profile = _find_profile(study, response.name)
    if profile is not None:
        settings["profile"] = {
            "x": list(profile.x),
            "functions": profile.functions,
            "covered": profile.covered,
        }
    return {
        "definition": {"name": defined.label, "settings": settings},
        "bench": _select_bench_settings(study, response.apparatus),
    }


def _find_chosen_response(study: CardStudy, response: Response) -> Response:
    """Find the response that names the definition which a study calibrates.

    The angle of repose has several definitions. The targets use its general name, and
    the configuration chooses a definition (`measure.response`). Each definition is also
    a response of its own, whose name ends with that of the definition. A response with
    a single definition is returned unchanged.
    """
    if CHOSEN_DEFINITION_KEY not in response.definition:
        return response
    name = name_derived_column(response.name, study.settings.measure.response)
    for other in bench(response.apparatus).responses:
        if other.name == name:
            return other
    # This bench test offers only the general response.
    return response


def _collect_definition_settings(
    study: CardStudy, response: Response, grain: Mapping[str, Any]
) -> dict[str, Any]:
    """Collect the settings of the configuration that define a response.

    A setting has the last part of its dotted key, such as `response` for
    `measure.response`. The last parts of the keys of a response differ.

    The height of a grain may be missing from the configuration. It is then computed
    from the grain, and rounded, so that the card does not depend on rounding errors.
    """
    settings = {}
    # `Response.settings` selects the settings of this response from a configuration.
    for dotted_key, value in response.settings(study.config).items():
        _, _, last_part = dotted_key.rpartition(".")
        settings[last_part] = value
    if GRAIN_HEIGHT_KEY in settings:
        height_mm = study.settings.measure.for_grain(grain).berry_height_mm
        settings[GRAIN_HEIGHT_KEY] = (
            None if height_mm is None else _round_to_six_digits(height_mm)
        )
    return settings


def _find_profile(study: CardStudy, response: str) -> ProfileSection | None:
    """Return the profile of the first target of a response; None for a number."""
    for target in study.settings.targets:
        if target.response == response:
            return target.profile
    return None


def _select_bench_settings(study: CardStudy, test_name: str) -> dict[str, Any]:
    """Return the settings of a bench test, except those of seeds and measurement.

    Parameters
    ----------
    study : CardStudy
        The study.
    test_name : str
        Name of the bench test.

    Returns
    -------
    dict
        The settings in the order of the section. Keys that the study omits are left
        out.
    """
    test = bench(test_name)
    section = study.config[test.name]
    excluded_keys = ("seeds", *test.measured_by)
    settings = {}
    for key in test.settings.model_fields:
        if key in section and key not in excluded_keys:
            settings[key] = section[key]
    return settings


def _describe_angles(
    measure: MeasureSettings, response_name: str, answer_row: Mapping[str, Any]
) -> dict[str, Any]:
    """Describe how the angle of a pile is defined, and list it by each definition.

    The angle is the slope of a line along the side of the pile. Each definition fits a
    different line.

    Parameters
    ----------
    measure : MeasureSettings
        The section `measure`, which defines the lines.
    response_name : str
        Name of a response.
    answer_row : mapping
        The row of the answer, the calibrated parameter set, in table4.csv. It may be
        empty.

    Returns
    -------
    dict
        ``line`` describes the line of the response. If the row has the angles by all
        definitions, ``definitions`` has for each definition the line, the mean angle
        and its standard error. The dict is empty if the response is not the angle of a
        pile.
    """
    from repose.measure.angles import MEAN_KEYS
    from repose.measure.settings import describe_line_of_response, line_of

    line = describe_line_of_response(measure, response_name)
    if not line:
        return {}
    # Without table4.csv the row is empty. The row of another simulator may lack the
    # angles. `MEAN_KEYS` has the column of the mean angle for each definition.
    has_all_angles = set(MEAN_KEYS.values()) <= set(answer_row)
    if not has_all_angles:
        return {"line": line}
    definitions: dict[str, dict[str, Any]] = {}
    for definition, column in MEAN_KEYS.items():
        definitions[definition] = {
            "line": line_of(measure, definition),
            "simulated": _replace_nan(answer_row[column]),
            "standard_error": _replace_nan(answer_row[name_error_column(column)]),
        }
    return {"line": line, "definitions": definitions}


def _replace_nan(value: float) -> float | None:
    """Replace NaN, which JSON does not have, by None."""
    return None if math.isnan(value) else float(value)


def _describe_grain(
    has_equal_grains: bool, grain: Mapping[str, Any], particle: "Particle"
) -> dict[str, Any]:
    """Describe the grain as it was simulated.

    Parameters
    ----------
    has_equal_grains : bool
        Whether all grains were simulated with the mean size.
    grain : mapping
        The content of `berry.json`.
    particle : Particle
        The simulated grain.
    """
    spheres_mm = [
        [_round_to_six_digits(1e3 * x) for x in row] for row in particle.spheres_m
    ]
    semi_axes_mm = [
        [_round_to_six_digits(1e3 * x) for x in row] for row in particle.semi_axes_m
    ]
    # A table of equal sizes repeats their mean, so it counts as one measurement.
    has_equal_sizes = grain["scale_sd"] < SMALLEST_SPREAD
    return {
        "mean_axes_mm": [grain[key] for key in SIZE_COLUMNS],
        "measured": 1 if has_equal_sizes else int(grain["n"]),
        "relative_spread": 0.0 if has_equal_grains else float(grain["scale_sd"]),
        **{key: grain[key] for key in GRAIN_KEYS},
        "shape": particle.kind,
        "volume_mm3": _round_to_six_digits(1e9 * particle.volume_m3),
        "mass_g": _round_to_six_digits(1e3 * particle.mass_kg),
        "inertia_kg_m2": [
            _round_to_six_digits(float(x)) for x in particle.inertia_kg_m2
        ],
        "ellipsoids_mm": semi_axes_mm,
        "spheres_mm": spheres_mm,
    }


def _round_to_six_digits(value: float) -> float:
    """Round to six significant digits, which no measurement exceeds."""
    return float(f"{value:.6g}")


# --- compare a card with a configuration ----------------------------------------------


def read_repose_card(card_json: StrPath) -> dict[str, Any]:
    """Read the card of a study that repose simulated; InputError for any other card."""
    content = card.read_card(card_json)
    if "simulator" in content:
        raise InputError(
            card_json,
            key="simulator",
            value=content["simulator"],
            allowed="the card of a study that repose simulated",
        )
    return content


def find_configuration(card_json: StrPath) -> Path | None:
    """Find the configuration that a run wrote next to its card, if there is one."""
    path = Path(card_json).with_name(CONFIG_FILE)
    return path if path.is_file() else None


def require_same_study(
    content: Mapping[str, Any],
    card_json: StrPath,
    study: CardStudy,
    source: StrPath,
    grain: Mapping[str, Any],
) -> None:
    """Raise an InputError unless a card and a configuration belong to the same study.

    Cards of earlier versions have no record of all settings. Therefore the values that
    a card states are compared with those of the configuration.

    Parameters
    ----------
    content : mapping
        The content of the card.
    card_json : path
        The file of the card, for the message.
    study : CardStudy
        The study of the configuration.
    source : path
        The file of the configuration, for the message.
    grain : mapping
        The grain of the configuration.

    Raises
    ------
    InputError
        If label, grain, wall, contact laws, gravity or a bench test differ.
    """
    card_values = _collect_card_values(content)
    study_values = _collect_study_values(study, grain, content["tests"])
    # Cards of earlier versions lack the gravity, so it cannot be compared.
    if GRAVITY_KEY not in card_values:
        study_values.pop(GRAVITY_KEY)
    # The keys are in the order of `_collect_study_values`, which begins with those that
    # tell two studies apart at a glance.
    different_keys = [
        key
        for key, value in study_values.items()
        if not _is_same(card_values.get(key), value)
    ]
    if not different_keys:
        return

    # The message shows both values of the first key, and only names the other keys.
    first_key, *other_keys = different_keys
    remark = ""
    if other_keys:
        remark = f"; other differences: {', '.join(other_keys)}"
    raise InputError(
        card_json,
        key=first_key,
        value=card_values.get(first_key),
        allowed=(
            f"{study_values[first_key]}, as in {source}: card and configuration of one "
            f"study{remark}"
        ),
    )


def _collect_card_values(content: Mapping[str, Any]) -> dict[str, Any]:
    """Collect those values of a card that a configuration states, too.

    `_collect_study_values` collects the same values from a configuration and must use
    the same keys.

    Parameters
    ----------
    content : mapping
        The content of the card.

    Returns
    -------
    dict
        The values by dotted key. A key begins with the section of the card, such as
        `wall.poisson_ratio`, or with the name of the bench test.
    """
    values: dict[str, Any] = {"material": content["material"]}
    for section in ("grain", "wall", "laws"):
        for key, value in content[section].items():
            values[f"{section}.{key}"] = value
    if "simulation" in content:  # cards of earlier versions lack it
        values[GRAVITY_KEY] = content["simulation"]["gravity_m_s2"]
    # In a test, `apparatus` is the name of the bench test, and `bench` its settings.
    for test in content["tests"]:
        for key, value in test["bench"].items():
            values[f"{test['apparatus']}.{key}"] = value
    return values


def _collect_study_values(
    study: CardStudy,
    grain: Mapping[str, Any],
    card_tests: Iterable[Mapping[str, Any]],
) -> dict[str, Any]:
    """Collect those values of a configuration that a card states, too.

    `_collect_card_values` collects the same values from a card and must use the same
    keys.

    Parameters
    ----------
    study : CardStudy
        The study of the configuration.
    grain : mapping
        The grain of the configuration. The mean of each axis has the name of its column
        in `SIZE_COLUMNS`.
    card_tests : iterable of mapping
        The tests of the card. They determine which bench tests are compared, and which
        of their settings.

    Returns
    -------
    dict
        The values by dotted key. A setting that the study lacks is None.
    """
    settings = study.settings
    values: dict[str, Any] = {
        # A card calls the label of its study the material.
        "material": settings.label,
        "grain.mean_axes_mm": [grain[key] for key in SIZE_COLUMNS],
    }
    for key in GRAIN_KEYS:
        values[f"grain.{key}"] = grain[key]
    for key in WALL_KEYS:
        values[f"wall.{key}"] = getattr(settings.wall, key)
    for direction, sentence in describe_laws(settings.simulation).items():
        values[f"laws.{direction}"] = sentence
    values[GRAVITY_KEY] = settings.simulation.gravity_m_s2

    # In a test, `apparatus` is the name of the bench test, and `bench` its settings.
    for test in card_tests:
        name = test["apparatus"]
        section = study.config.get(name, {})
        for key in test["bench"]:
            values[f"{name}.{key}"] = section.get(key)
    return values


def _is_same(first: object, second: object) -> bool:
    """Tell whether two values are equal, numbers within `RELATIVE_TOLERANCE`."""
    if isinstance(first, list) and isinstance(second, list):
        return len(first) == len(second) and all(map(_is_same, first, second))
    if isinstance(first, int | float) and isinstance(second, int | float):
        return math.isclose(first, second, rel_tol=RELATIVE_TOLERANCE)
    return first == second


# --- rebuild the configuration and the particle for an export -------------------------


def rebuild_configuration(content: Mapping[str, Any], source: object) -> dict[str, Any]:
    """Rebuild from a card those sections of a configuration that the export needs.

    The export writes the input script of another simulator.

    Parameters
    ----------
    content : mapping
        The card of a study with piles of the funnel.
    source : object
        Its file, for messages.

    Returns
    -------
    dict
        The sections `berry`, `wall`, `simulation` and `funnel`, and the `label`. If the
        card states no time step, it is `UPPER_TIME_STEP_S`.

    Raises
    ------
    InputError
        If the card has no pile of the funnel, or laws of another version.
    """
    funnel = _rebuild_funnel(content, source)
    # The values of the card replace the defaults above them.
    simulation = {
        "gravity_m_s2": DEFAULT_GRAVITY_M_S2,
        "time_step_s": UPPER_TIME_STEP_S,
        **content.get("simulation", {}),
        "rest_energy_j": REST_ENERGY_J,
        **_find_laws(content, source),
    }
    sizes = "measured" if content["grain"]["relative_spread"] else "none"
    return {
        "label": content["material"],
        "berry": {"size_distribution": sizes},
        "wall": dict(content["wall"]),
        "simulation": simulation,
        "funnel": funnel,
    }


def _rebuild_funnel(content: Mapping[str, Any], source: object) -> dict[str, Any]:
    """Rebuild the section `funnel` of a configuration from a card.

    Parameters
    ----------
    content : mapping
        The content of the card.
    source : object
        Its file, for messages.

    Returns
    -------
    dict
        The section. It asks for a single run, because a card does not state how many
        seeds the study had.

    Raises
    ------
    InputError
        If no test of the card used the funnel, or if its settings are wrong.
    """
    # In a test, `apparatus` is the name of the bench test, and `bench` its settings.
    sections = []
    for test in content["tests"]:
        if test["apparatus"] == "funnel" and test["bench"] is not None:
            sections.append(test["bench"])
    if not sections:
        names = [test["apparatus"] for test in content["tests"]]
        raise InputError(
            source,
            key="tests",
            value=names,
            allowed="the card of a study with piles of the funnel",
        )

    # Several targets of the funnel have the same settings, so take the first ones.
    funnel = {**sections[0], "seeds": 1}
    try:
        FunnelSettings.model_validate(funnel)
    except ValidationError as error:
        # This always raises, because a ValidationError has at least one entry.
        raise_together(card.translate_errors(error, source, prefix="tests.bench."))
    return funnel


def _find_laws(content: Mapping[str, Any], source: object) -> dict[str, str]:
    """Find the names of the contact laws that a card describes in sentences.

    A card states sentences and no names. The function therefore describes every
    combination of laws by `describe_laws`, until the sentences are those of the card.
    If a later version changes a sentence, the laws of older cards are not found.

    Parameters
    ----------
    content : mapping
        The content of the card.
    source : object
        Its file, for messages.

    Returns
    -------
    dict
        `contact_law`, `tension` and `rolling_law` of the section `simulation`.

    Raises
    ------
    InputError
        If no combination has these sentences.
    """
    from repose.dem.laws import CONTACT_LAWS, ROLLING_LAWS

    # The values that `simulation.tension` may have.
    tensions = ("release", "keep")
    for contact, tension, rolling in product(CONTACT_LAWS, tensions, ROLLING_LAWS):
        law_names = {"contact_law": contact, "tension": tension, "rolling_law": rolling}
        # Skip the validation, which would require the other keys of the section. Only
        # these three determine the sentences.
        settings = SimulationSettings.model_construct(None, **law_names)
        if describe_laws(settings) == content["laws"]:
            return law_names
    raise InputError(
        source,
        key="laws",
        value=content["laws"].get("normal"),
        allowed="laws of this version; give the study's configuration with --configfile",
    )


def rebuild_particle(
    content: Mapping[str, Any], n_spheres: int | None, source: object
) -> "Particle":
    """Rebuild the simulated particle from a card.

    Parameters
    ----------
    content : mapping
        The card.
    n_spheres : int or None
        Number of spheres with which a smooth body is filled. With None or 1, the
        particle remains as the card describes it.
    source : object
        The card's file, for messages.

    Returns
    -------
    Particle

    Raises
    ------
    InputError
        If the card has no body, or lacks the moments of inertia of a clump.
    """
    particle = _read_particle(content["grain"], source)
    # A clump keeps the spheres that were simulated.
    if n_spheres is None or n_spheres == 1 or particle.is_clump:
        return particle
    return _fill_with_spheres(particle, n_spheres)


def _read_particle(grain: Mapping[str, Any], source: object) -> "Particle":
    """Read the simulated particle from the section `grain` of a card.

    `source` is the card's file, for messages.
    """
    from repose.grain.particle import Particle

    # The grain is a sum of ellipsoids or a clump of spheres. A row has the semi-axes of
    # an ellipsoid, or the centre and the radius of a sphere.
    semi_axes_m = 1e-3 * np.array(grain["ellipsoids_mm"], float).reshape(-1, 3)
    spheres_m = 1e-3 * np.array(grain["spheres_mm"], float).reshape(-1, 4)
    if len(semi_axes_m) == 0 and len(spheres_m) == 0:
        raise InputError(
            source,
            key="grain.ellipsoids_mm",
            value=[],
            allowed="the half axes of a body",
        )
    radius_m = _compute_enclosing_radius(semi_axes_m, spheres_m)
    mass_kg = 1e-3 * grain["mass_g"]

    # A card of an earlier version has no moments of inertia. For a smooth grain, those
    # of a solid sphere stand in for them. The export replaces such a grain by a sphere
    # or a clump anyway, whose moments are computed again. For a clump they are needed.
    inertia_kg_m2 = grain.get("inertia_kg_m2")
    if inertia_kg_m2 is None:
        if len(spheres_m) > 1:
            raise InputError(
                source,
                key="grain.inertia_kg_m2",
                value=None,
                allowed=(
                    "the moments of inertia of the clump, which cards of earlier "
                    "versions lack; give the study's configuration with --configfile"
                ),
            )
        inertia_kg_m2 = np.full(3, SPHERE_INERTIA_FACTOR * mass_kg * radius_m**2)

    return Particle(
        kind=grain["shape"],
        semi_axes_m=semi_axes_m,
        density_kg_m3=grain["density_kg_m3"],
        volume_m3=1e-9 * grain["volume_mm3"],
        mass_kg=mass_kg,
        inertia_kg_m2=np.array(inertia_kg_m2),
        bounding_radius_m=float(radius_m),
        # The card does not state the distance between the particle and the mesh of a
        # grain.
        deviation_max_m=0.0,
        deviation_rms_m=0.0,
        spheres_m=spheres_m,
    )


def _compute_enclosing_radius(
    semi_axes_m: np.ndarray, spheres_m: np.ndarray
) -> np.floating:
    """Compute the radius of a sphere about the centre of mass that encloses a body.

    Parameters
    ----------
    semi_axes_m : ndarray
        Semi-axes (K, 3) of ellipsoids. The body is their Minkowski sum, so its own
        semi-axes are the sums of theirs.
    spheres_m : ndarray
        Centres and radii (M, 4) of the spheres of a clump. If there are none, the body
        consists of the ellipsoids.
    """
    if len(spheres_m) > 0:
        centre_distances_m = np.linalg.norm(spheres_m[:, :3], axis=1)
        return (centre_distances_m + spheres_m[:, 3]).max()
    return semi_axes_m.sum(axis=0).max()


def _fill_with_spheres(particle: "Particle", n_spheres: int) -> "Particle":
    """Replace a smooth particle by a clump of spheres with the same mass and shape.

    Parameters
    ----------
    particle : Particle
        An ellipsoid, or a sum of several.
    n_spheres : int
        Number of spheres in the clump.
    """
    import trimesh  # slow to import

    from repose.dem.tessellation import tessellate
    from repose.grain import build
    from repose.grain.mesh import move_to_principal_pose

    # The builder of clumps needs a mesh with lengths in mm.
    points_m, _, triangles = tessellate(particle, MESH_RINGS, MESH_POINTS_OF_RING)
    mesh = trimesh.Trimesh(1e3 * points_m, triangles)
    clump = build.make_particle(
        move_to_principal_pose(mesh),
        particle.density_kg_m3,
        kind="multisphere",
        spheres=n_spheres,
    )
    # The mesh is slightly smaller than the body, so restore the mass of the body.
    return replace(
        clump,
        mass_kg=particle.mass_kg,
        inertia_kg_m2=particle.mass_kg / clump.mass_kg * clump.inertia_kg_m2,
    )
