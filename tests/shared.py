"""What several tests share."""

import functools
import json
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from repose import bench
from repose.bench import bench_tests
from repose.bench.parameters import PARAMETERS
from repose.bench.space import contact_space
from repose.calibrate import responses
from repose.calibrate.settings import CalibrationSettings
from repose.calibrate.surrogates.settings import NetworkSettings
from repose.calibrate.targets import Targets
from repose.common.section import Section
from repose.config import models
from repose.config.pipeline import PipelineConfig

ROOT = Path(__file__).parents[1]
# The bench tests whose names, limits and scenes `known/` holds. One that is added later need not be here.
BUILT_IN = (
    "funnel",
    "drum",
    "cylinder",
    "discharge",
    "turning",
    "lifted_cylinder",
    "inclined_plane",
    "drop_test",
    "drawdown",
)
# The article's parameter ranges and targets.
RANGES = {
    "e_gg": [0.1, 0.4],
    "mus_gg": [0.35, 0.75],
    "mur_gg": [0.02, 0.07],
    "e_gp": [0.2, 0.5],
    "mus_gp": [0.4, 0.8],
    "mur_gp": [0.1, 0.3],
}


def target(response, value, sd, low, high, repetitions=10, **more):
    """An entry of a configuration's targets."""
    entry = {
        "response": response,
        "apparatus": responses.response(response).apparatus,
        "value": value,
        "sd": sd,
    }
    return entry | {"repetitions": repetitions, "range": [low, high]} | more


TARGETS = [
    target("aor_deg", 32.87, 2.20, 31.0, 34.0),
    target("height_mm", 65.57, 4.10, 64.0, 69.0),
]


def entries(targets):
    return [
        target(
            entry.name, entry.value, entry.sd, entry.low, entry.high, entry.repetitions
        )
        for entry in targets
    ]


MIGA = {
    "islands": 5,
    "population": 40,
    "rounds": 40,
    "generations": 10,
    "tournament": 3,
    "mutation_probability": 0.05,
    "mutation_amplitude": 0.1,
    "solutions": 30,
    "distance": 0.05,
    "answer": "least_expected_loss",
    "replicates": 4,
    "seed": 2026,
}
SLIP = target("drum_slip_deg", 31.0, 1.0, 20.0, 40.0, 5)


def settings_of(config):
    """The sections of a configuration that has only some of them, unchecked."""
    fields = models.make_settings_type().model_fields
    sections = {}
    for name, value in config.items():
        kind = fields[name].annotation if name in fields else None
        is_section = isinstance(kind, type) and issubclass(kind, Section)
        if name == "targets":
            value = [models.TargetSettings.model_construct(**entry) for entry in value]
        elif name == "network":
            value = NetworkSettings.from_keys(value)
        elif is_section and isinstance(value, dict):
            value = kind.model_construct(**value)
        sections[name] = value
    return models.make_settings_type().model_construct(**sections)


def calibration_settings_of(config):
    """The same as the settings of `repose.Study`, with the sections that it may read."""
    sections = dict(settings_of(config))
    benches = (config[name] for name in bench.names() if name in config)
    seeds = [section["seeds"] for section in benches if "seeds" in section]
    return CalibrationSettings.model_construct(
        simulator="repose", seeds=(seeds or [None])[0], **sections
    )


def studied(config, **more):
    """A study of a small configuration, unchecked."""
    config = (
        {
            "label": "made_up",
            "strategy": "published",
            "small_run": False,
            "measure": None,
        }
        | config
        | more
    )
    space = contact_space(config.get("parameters", RANGES))
    targets = Targets.of(config["targets"])
    return SimpleNamespace(
        config=config,
        settings=settings_of(config),
        simulator=None,
        parameter_names=None,
        parameters=space,
        targets=targets,
    )


def study_of(
    targets, space=None, definitions=(), measure=None, surrogate="network", **sections
):
    """A study of targets, with some sections of its settings."""
    settings = SimpleNamespace(surrogate=surrogate, measure=measure, **sections)
    return SimpleNamespace(
        targets=targets,
        parameters=space,
        definitions=dict(definitions),
        settings=settings,
        simulator=None,
        parameter_names=None,
    )


@functools.cache
def every_bench_test():
    """The program's configuration with a section for every bench test: its own, or the example."""
    config = PipelineConfig.load(ROOT / "config/config.yaml").config
    for test in bench_tests():
        config.setdefault(test.name, dict(test.example[test.name]))
    return config


def targets_of(sd_percent=5.0, **values):
    """Targets of these values by the names of their responses, all measured four times."""
    entry = {
        name: (value, sd_percent / 100 * value, 0.95 * value, 1.05 * value)
        for name, value in values.items()
    }
    return Targets.of(
        [target(name, *numbers, repetitions=4) for name, numbers in entry.items()]
    )


def one_run(seed, status="ok", aor=22.0, height=60.0, reason=""):
    ok = status == "ok"
    return {
        "seed": seed,
        "status": status,
        "reason": reason,
        "aor_deg": aor if ok else None,
        "height_mm": height if ok else None,
        "discharge_s": 15.0 + seed,
        "berries_on_plate": 500,
        "berries_in_pile": 460,
        "berries_off_plate": 0,
        "kinetic_energy_J": 1e-12,
    }


def good_run(seed, **values):
    """A run of any bench test that ended well, with these values."""
    return {"seed": seed, "status": "ok", "reason": ""} | values


def write_jobs(table, folder, runs_of, names=PARAMETERS, **more):
    """Write the job of each row of a table of samples, with the runs that `runs_of(row)` gives; the paths."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for row in table.to_dict("records"):
        job = {
            "sample": row["sample"],
            "parameters": {name: row[name] for name in names},
            "runs": [*runs_of(row)],
        }
        paths.append(folder / f"{more.get('apparatus', '')}{row['sample']:03}.json")
        paths[-1].write_text(json.dumps(job | more))
    return paths


def written(path, content):
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def says(text, *phrases):
    assert [phrase for phrase in phrases if phrase not in text] == []


def at(config, key):
    """The value of a dotted key; the whole without one."""
    for part in filter(None, key.split(".")):
        config = config[int(part) if isinstance(config, list) else part]
    return config


def put(config, key, value):
    section, _, last = key.rpartition(".")
    at(config, section)[last] = value
    return config


def run_python(*arguments, **options):
    """Run `python WORDS` in a process of its own, which must succeed; what it prints."""
    done = subprocess.run(
        [sys.executable, *map(str, arguments)],
        capture_output=True,
        text=True,
        **options,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def check_all(check, cases):
    """Call `check` with the arguments of every case, then fail once with the names of all cases that failed."""
    failed = []
    for name, *arguments in cases:
        try:
            check(*arguments)
        except (Exception, pytest.fail.Exception) as error:
            failed.append(f"{name}: {type(error).__name__}: {error}")
    assert not failed, "\n".join([f"{len(failed)} cases failed", *failed])
