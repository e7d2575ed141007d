"""The configuration: read strictly, checked against one schema and against itself before any work starts.

`workflow/schemas/config.schema.yaml` says which keys there are and their ranges; what one key asks of
another, and of the files it names, is checked here. Every fault ends in one InputError that tells file, key,
value and what is allowed.
"""

import copy
import csv
import difflib
import json
import math
import re
from functools import cache
from pathlib import Path

import yaml

from repose.core.errors import InputError
from repose.core.parameters import PARAMETERS

SCHEMA_PATH = Path(__file__).parents[3] / "workflow" / "schemas" / "config.schema.yaml"
COMMAND_LINE = "command line (--config)"
# Folders of the project that results must never be written into.
OUR_OWN_FOLDERS = ("src", "config", "resources", "workflow", "profiles", "tests", "docs", "results/published")
# AoR and Height hold to 13 % of the berry's Rayleigh time and break at 32 %.
LARGEST_RAYLEIGH_SHARE = 0.2
# What the random numbers of a pour are for: one stream each, so that no check reuses the pours it checks.
PURPOSES = {
    "design": 0,
    "validation": 1,
    "drum": 2,
    "shape_published": 3,
    "shape_sensitivity": 4,
    "shape_design": 5,
    "drum_design": 9,
    "refine": 8,
    "pool": 6,
    "fresh": 7,
}
WHOLE = {f"shape_study.{key}" for key in ("particles", "fillings", "sensitivities")}
LARGEST_BLOCKS = 100  # of a refined proposal's pours: jobs of a round have three digits
# Measured on one core of a common server: for the estimate that is shown before a run.
SECONDS_A_BERRY_STEP = 4.5e-8
SECONDS_A_VIEW = 0.01
JOB_START_S = 2.5  # of a pour's job and of its measurement's
TABLE4_COLUMNS = (
    "solution",
    *PARAMETERS,
    "aor_predicted_deg",
    "height_predicted_mm",
    "aor_simulated_deg",
    "height_simulated_mm",
)


class _StrictLoader(yaml.SafeLoader):
    """YAML that refuses a key given twice and reads 2e-4 as the number it is (YAML 1.1 takes it for text)."""

    def construct_mapping(self, node, deep=False):
        seen = set()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=deep)
            if key in seen:
                raise InputError(
                    f"{self.name}, line {key_node.start_mark.line + 1}", key, "given again", "each key once"
                )
            seen.add(key)
        return super().construct_mapping(node, deep)


_StrictLoader.add_implicit_resolver(
    "tag:yaml.org,2002:float", re.compile(r"^[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+$"), list("-+.0123456789")
)


def read(path):
    """The mapping in a YAML or JSON file, unchecked; InputError for no file, bad syntax, a key twice."""
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(path, "file", error.strerror, "an existing YAML or JSON file") from None
    except UnicodeDecodeError:
        raise InputError(path, "file", "not text", "a YAML or JSON file in UTF-8") from None
    content = _parse(text, str(path))
    if not isinstance(content, dict):
        raise InputError(path, "content", content, "keys with values, as in config/config.yaml")
    return content


def load(path):
    """A complete configuration from a file, checked by `check`."""
    return check(read(path), str(path))


def resolve(files, overrides=None):
    """A workflow's configuration: later files over earlier ones, over them the command line; checked.

    files: paths, the first complete, the others as partial as one likes; overrides: nested mapping whose
    text is read as YAML values. An error names the file that the bad value came from. Raises InputError.
    """
    config, origin = {}, {}
    for path in files:
        _merge(config, read(path), origin, str(path))
    _merge(config, _values(overrides or {}), origin, COMMAND_LINE)
    source = _Origin(origin, str(files[0]))
    check(config, source)
    check_inputs(config, source)
    return config


def check(config, source="configuration"):
    """Return config when schema and cross checks hold, else raise InputError with the first fault.

    source: the name of the file, for the message. Keys of the file's inputs are left to `check_inputs`.
    """
    errors = sorted(
        _validator().iter_errors(config),
        # A mistyped key is also a missing one; the mistyping is the better news.
        key=lambda error: (error.validator != "additionalProperties", list(map(str, error.absolute_path))),
    )
    if errors:
        raise _input_error(errors[0], config, source)
    for key, allowed in _contradictions(config):
        raise InputError(_of(source, key), key, _get(config, key), allowed)
    return config


def check_inputs(config, source="configuration"):
    """InputError unless the files that a checked config names can be used; and berry, bench, step fit."""
    from repose.particle import berry

    for key in ("berry.sizes", "berry.compression", "berry.stl", "validation.published"):
        path = _get(config, key)
        if path is not None and not Path(path).is_file():
            raise InputError(_of(source, key), key, path, "an existing file, seen from the project's folder")
    section = config["berry"]
    sizes = berry.read_sizes(section["sizes"])
    poisson, shear = section["poisson_ratio"], section["shear_modulus_pa"]
    if poisson is None or shear is None:
        elastic, measured, _ = berry.moduli(berry.read_compression(section["compression"]))
        poisson = measured if poisson is None else poisson
        shear = berry.shear_modulus(elastic, poisson) if shear is None else shear
    axes_mm = [float(sizes[column].mean()) for column in berry.SIZE_COLUMNS]
    published_count(config["validation"]["published"])
    _check_fits_berry(config["heap"], axes_mm, source)
    _check_fits_drum(config["drum"], max(axes_mm), source)
    limit = LARGEST_RAYLEIGH_SHARE * rayleigh_time_s(axes_mm, section["density_kg_m3"], poisson, shear)
    if config["heap"]["time_step_s"] > limit:
        key = "heap.time_step_s"
        allowed = f"at most {limit:.2g}, {LARGEST_RAYLEIGH_SHARE:.0%} of the Rayleigh time of the mean berry"
        raise InputError(_of(source, key), key, config["heap"]["time_step_s"], allowed)


def rayleigh_time_s(axes_mm, density_kg_m3, poisson, shear_modulus_pa):
    """Time that a Rayleigh wave takes over the sphere of equal volume, s; axes_mm are the three full axes.

    pi R sqrt(density / G) / (0.1631 nu + 0.8766), the usual measure of a DEM time step.
    """
    radius = 0.5e-3 * math.prod(axes_mm) ** (1 / 3)
    return math.pi * radius * math.sqrt(density_kg_m3 / shear_modulus_pa) / (0.1631 * poisson + 0.8766)


def pour_seeds(study_seed, purpose, number, count):
    """Seeds of the `count` pours of one parameter set.

    study_seed: `design.seed`; purpose: one of PURPOSES; number: of the sample. The first k seeds
    are the same for any count of at least k.
    """
    import numpy as np

    state = np.random.SeedSequence([study_seed, PURPOSES[purpose], number]).generate_state(count)
    return [int(seed) for seed in state]


def work(config):
    """What a run takes: pours as (purpose, parameter sets, seeds), pour_s and total_s on one core."""
    heap, validation = config["heap"], config["validation"]
    pours = (
        ("design", config["design"]["samples"], heap["seeds"]),
        ("representative", 1, validation["representative_seeds"]),
        ("validation", validation["solutions"], validation["seeds"]),
        ("published", published_count(validation["published"]), validation["seeds"]),
    )
    pour_s = SECONDS_A_BERRY_STEP * heap["berries"] * heap["duration_s"] / heap["time_step_s"]
    pour_s += SECONDS_A_VIEW * config["measure"]["views"]
    total_s = sum(sets * (JOB_START_S + seeds * pour_s) for _, sets, seeds in pours)
    drum = config["drum"]
    drum_s = drum["rotate_from_s"] + drum["longest_rotation_s"] + drum["settle_s"]
    drum_s *= SECONDS_A_BERRY_STEP * drum["berries"] / heap["time_step_s"]
    total_s += drum["seeds"] * (JOB_START_S + drum_s)
    return {"pours": pours, "pour_s": pour_s, "total_s": total_s}


def published_count(path):
    """Number of solutions in a published table; InputError unless the table has its columns."""
    with Path(path).open(encoding="utf-8", newline="") as lines:
        rows = csv.DictReader(lines)
        columns = rows.fieldnames or []
        for column in TABLE4_COLUMNS:
            if column not in columns:
                raise InputError(path, "header", ",".join(columns), f"columns {', '.join(TABLE4_COLUMNS)}")
        return len(list(rows))


def write_resolved(config, path):
    """Write config as JSON to path, but only where that changes the file."""
    path = Path(path)
    text = json.dumps(config, indent=1) + "\n"
    if not path.is_file() or path.read_text() != text:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


def _parse(text, name):
    """YAML (of which JSON is a part) as plain values, or InputError with the line."""
    loader = _StrictLoader(text)
    loader.name = name
    try:
        return loader.get_single_data()
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else "?"
        raise InputError(
            name, f"line {line}", error.problem, "valid YAML (indent by spaces, no tabs)"
        ) from None
    except yaml.YAMLError as error:
        raise InputError(name, "content", str(error), "valid YAML") from None
    finally:
        loader.dispose()


def _values(value):
    """Overrides with their text read as YAML: the command line gives 2 and [1, 2] as text."""
    if isinstance(value, dict):
        return {key: _values(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_values(item) for item in value]
    return _parse(value, COMMAND_LINE) if isinstance(value, str) and value.strip() else value


def _merge(config, more, origin, source, prefix=""):
    """Put `more` over config, section by section, and note in origin where each key came from.

    Sections whose keys are names (WHOLE) are replaced: who lists two fillings wants two.
    """
    for key, value in more.items():
        name = f"{prefix}{key}"
        origin[name] = source
        if name not in WHOLE and isinstance(value, dict) and isinstance(config.get(key), dict):
            _merge(config[key], value, origin, source, f"{name}.")
        else:
            config[key] = copy.deepcopy(value)
            if isinstance(value, dict):
                _merge(config[key], value, origin, source, f"{name}.")


class _Origin:
    """Where each dotted key came from; a key that is nowhere belongs to the first file."""

    def __init__(self, origin, default):
        self.origin, self.default = origin, default

    def of(self, key):
        return self.origin.get(key, self.default)


def _of(source, key):
    """Name of the file that holds key."""
    return source.of(key) if isinstance(source, _Origin) else source


@cache
def _validator():
    """The schema's validator; numbers are finite, and 8.0 is no integer."""
    import jsonschema

    base = jsonschema.Draft202012Validator
    types = base.TYPE_CHECKER.redefine_many(
        {
            "number": lambda _, value: type(value) in (int, float) and math.isfinite(value),
            "integer": lambda _, value: type(value) is int,
        }
    )
    schema = yaml.safe_load(SCHEMA_PATH.read_text())
    return jsonschema.validators.extend(base, type_checker=types)(schema)


def _input_error(error, config, source):
    """A fault found by the schema as an InputError; one inside a list is told of the list."""
    path = [str(step) for step in error.absolute_path if not isinstance(step, int)]
    section = ".".join(path)
    if error.validator == "additionalProperties":
        known = sorted(error.schema["properties"])
        extra = next(key for key in error.instance if key not in known)
        key = f"{section}.{extra}" if section else str(extra)
        near = difflib.get_close_matches(str(extra), known, 1)
        hint = f"did you mean {near[0]}?" if near else f"keys here: {', '.join(known)}"
        return InputError(_of(source, key), key, error.instance[extra], f"no such key; {hint}")
    if error.validator == "required":
        missing = next(key for key in error.validator_value if key not in error.instance)
        path.append(missing)
        key = ".".join(path)
        return InputError(
            _of(source, section), key, None, f"{_allowed(_subschema(path))}; the key is missing"
        )
    return InputError(_of(source, section), section, _get(config, section), _allowed(_subschema(path)))


def _subschema(path):
    """The schema of the key at path, references followed."""
    schema = root = _validator().schema
    for step in path:
        schema = schema["properties"][step]
        while "$ref" in schema:
            schema = root["$defs"][schema["$ref"].rsplit("/", 1)[1]]
    return schema


def _allowed(schema):
    """In words, what a schema takes."""
    if "description" in schema:
        return schema["description"]
    if "enum" in schema:
        return " or ".join(map(str, schema["enum"]))
    types = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
    words = {"integer": "an integer", "number": "a number", "string": "text", "boolean": "true or false"}
    words |= {"null": "null", "object": "a section with the keys " + ", ".join(schema.get("properties", ()))}
    text = words[types[0]]
    if "exclusiveMinimum" in schema:
        text += f" above {schema['exclusiveMinimum']:g} and up to {schema['maximum']:g}"
    elif "minimum" in schema:
        text += f" from {_plain(schema['minimum'])} to {_plain(schema['maximum'])}"
    elif "maxLength" in schema:
        text += f" of 1 to {schema['maxLength']} characters"
    return " or ".join([text, *(words[kind] for kind in types[1:])])


def _plain(number):
    """A bound as a reader would write it."""
    return str(number) if isinstance(number, int) else f"{number:g}"


def _get(config, key):
    """Value of a dotted key."""
    for step in key.split("."):
        config = config[step]
    return config


def _contradictions(config):
    """Pairs (dotted key, what is allowed) where a value does not go with another one."""
    yield from _range_contradictions(config)
    yield from _heap_contradictions(config["heap"])
    yield from _drum_contradictions(config["drum"], config["heap"]["time_step_s"])
    folder = Path(config["results_dir"])
    if ".." in folder.parts or folder == Path() or any(folder.is_relative_to(own) for own in OUR_OWN_FOLDERS):
        yield "results_dir", f"a folder of its own, without .. and outside {', '.join(OUR_OWN_FOLDERS)}"
    berry, network = config["berry"], config["network"]
    if berry["compression"] is None and None in (berry["poisson_ratio"], berry["shear_modulus_pa"]):
        yield (
            "berry.compression",
            "a path of a file, unless poisson_ratio and shear_modulus_pa are both given",
        )
    if abs(sum(network["split"]) - 1) > 1e-6 or network["split"][0] == 0 or network["split"][2] == 0:
        yield "network.split", "three shares that sum to 1, those of training and test above 0"
    if network["weights_from_errors"] and config["heap"]["seeds"] < 4:
        yield (
            "network.weights_from_errors",
            "false where heap.seeds is below 4: there are no standard errors to use",
        )
    if network["correlated_noise"] and config["heap"]["seeds"] < 2:
        yield (
            "network.correlated_noise",
            "false where heap.seeds is 1: pours of one sample cannot be compared",
        )
    design, further = config["design"]["samples"], config["second_responses"]
    if further["drum_samples"] > design:
        yield "second_responses.drum_samples", f"at most design.samples, {design}"
    refine = config["refine"]
    if refine["seeds"] > LARGEST_BLOCKS * refine["block"]:
        yield "refine.block", f"at least refine.seeds / {LARGEST_BLOCKS}"
    if refine["neighbours"] == 1:
        yield "refine.neighbours", "0 or at least 2: they fill a Latin hypercube"
    if config["miga"]["tournament"] > config["miga"]["population"]:
        yield "miga.tournament", f"at most miga.population, {config['miga']['population']}"


def _range_contradictions(config):
    """Intervals that are empty, and values outside the interval they belong to."""
    for name in PARAMETERS:
        if not config["parameters"][name][0] < config["parameters"][name][1]:
            yield f"parameters.{name}", _allowed(_subschema(["parameters", name]))
    target = config["target"]
    for value, interval in (("aor_deg", "aor_range_deg"), ("height_mm", "height_range_mm")):
        low, high = target[interval]
        if not low < high:
            yield f"target.{interval}", _allowed(_subschema(["target", interval]))
        elif not low <= target[value] <= high:
            yield f"target.{value}", f"inside target.{interval}, {low:g} to {high:g}"
    start, end = config["measure"]["fit_from"], config["measure"]["fit_to"]
    if start == end == "berry":
        yield "measure.fit_to", "a number from 0.1 to 1, as measure.fit_from is berry"
    elif "berry" not in (start, end) and end < start + 0.1:
        yield "measure.fit_to", f"at least 0.1 above measure.fit_from, {start:g}"


def _heap_contradictions(heap):
    """A bench that cannot be built or a pour that cannot end."""
    if heap["outlet_diameter_mm"] >= heap["inlet_diameter_mm"]:
        yield "heap.outlet_diameter_mm", f"below heap.inlet_diameter_mm, {heap['inlet_diameter_mm']:g}"
    if heap["factory_diameter_mm"] > heap["inlet_diameter_mm"]:
        yield "heap.factory_diameter_mm", f"at most heap.inlet_diameter_mm, {heap['inlet_diameter_mm']:g}"
    if heap["plate_diameter_mm"] < heap["outlet_diameter_mm"]:
        yield "heap.plate_diameter_mm", f"at least heap.outlet_diameter_mm, {heap['outlet_diameter_mm']:g}"
    wall = (heap["inlet_diameter_mm"] - heap["outlet_diameter_mm"]) / 4
    if heap["rim_radius_mm"] > wall:
        yield "heap.rim_radius_mm", f"at most {wall:g}, or no cone is left between inlet and outlet"
    if heap["rest_window_s"] >= heap["duration_s"]:
        yield "heap.rest_window_s", f"below heap.duration_s, {heap['duration_s']:g}"
    if heap["time_step_s"] > heap["rest_window_s"] / 2:
        yield "heap.time_step_s", f"at most half of heap.rest_window_s, {heap['rest_window_s']:g}"
    last = (heap["berries"] - 1) / heap["rate_per_s"]
    if last >= heap["duration_s"] - heap["rest_window_s"]:
        yield (
            "heap.duration_s",
            f"above {last + heap['rest_window_s']:g}: the last berry appears at {last:g} s",
        )


def _drum_contradictions(drum, time_step_s):
    """A drum without room, a rotation that begins before the last berry is there, a record finer than the steps."""
    radius = drum["outer_diameter_mm"] / 2 - drum["wall_thickness_mm"]
    if radius <= 0:
        yield "drum.wall_thickness_mm", f"below half of drum.outer_diameter_mm, {drum['outer_diameter_mm']:g}"
    elif abs(drum["factory_height_mm"]) >= radius:
        yield "drum.factory_height_mm", f"inside the drum, between -{radius:g} and {radius:g}"
    last = (drum["berries"] - 1) / drum["rate_per_s"]
    if last >= drum["rotate_from_s"]:
        yield "drum.rotate_from_s", f"above {last:g}, when the last berry appears"
    if drum["report_s"] < drum["rotate_from_s"]:
        yield "drum.report_s", f"at least drum.rotate_from_s, {drum['rotate_from_s']:g}"
    if drum["record_s"] < time_step_s:
        yield "drum.record_s", f"at least heap.time_step_s, {time_step_s:g}"


def _check_fits_berry(heap, axes_mm, source):
    """Raise InputError where a mean berry fits neither through the outlet nor into the factory."""
    for key, smallest in (("outlet_diameter_mm", axes_mm[2]), ("factory_diameter_mm", axes_mm[0])):
        if heap[key] <= smallest:
            name = f"heap.{key}"
            raise InputError(
                _of(source, name), name, heap[key], f"above {smallest:.4g}, the size of a mean berry"
            )


def _check_fits_drum(drum, long_mm, source):
    """Raise InputError where a mean berry of length long_mm cannot lie across the drum at the factory's height."""
    radius = drum["outer_diameter_mm"] / 2 - drum["wall_thickness_mm"]
    highest = radius - long_mm / 2
    for key, value, fits, allowed in (
        ("length_mm", drum["length_mm"], drum["length_mm"] > long_mm, f"above {long_mm:.4g}"),
        (
            "factory_height_mm",
            drum["factory_height_mm"],
            abs(drum["factory_height_mm"]) < highest,
            f"between -{highest:.4g} and {highest:.4g}" if highest > 0 else "a wider drum",
        ),
    ):
        if not fits:
            name = f"drum.{key}"
            raise InputError(_of(source, name), name, value, f"{allowed}, so that a mean berry fits")
