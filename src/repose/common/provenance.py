"""Record the origin of a result, and write it with the result.

A stage is one subcommand with its settings and the files that it reads. While it runs,
the writers of `repose.common.files` put its record into every file. A user's own
program is not a stage, so its files have no record. docs/howto.md explains the entries.
"""

import hashlib
import json
import os
import platform
import subprocess
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache
from os import PathLike
from pathlib import Path
from typing import Any, Literal

from repose import __version__
from repose.common import attached, places
from repose.common.errors import InputError
from repose.common.places import PACKAGE
from repose.common.source_code import code_hash

Record = Mapping[str, Any]
Config = Mapping[str, Any]
Inputs = Iterable[tuple[Path, Record | None]]  # files with their records
# Packages whose code computes a run: the simulator, the grains and the bench tests.
ENGINE_ROOMS = ("dem", "grain", "bench")
CPU_INFO = Path("/proc/cpuinfo")
COMMIT_FILE = "commit.txt"  # among the program's data files; a build writes it
# These environment variables make numba and numpy behave as on another type of
# processor. Results then differ in their last bits.
FORCED_TYPES = ("NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES", "OPENBLAS_CORETYPE")


@dataclass
class _Stage:
    """The stage that is running.

    Attributes
    ----------
    heading : dict
        The first entries of its record: the subcommand, and other names that identify
        the stage.
    inputs : list of (Path, mapping or None)
        Its input files with their records. A file may have none.
    settings_of : callable
        Function that selects the settings that it reads; see `record_stage`.
    simulates : bool
        Whether its results are runs of the engine.
    check : callable or None
        Function that rejects files of another study; see `record_stage`.
    config : mapping or None
        The whole configuration; None until `note_config` is called.
    record : dict or None
        The record; None until the first file is written.
    """

    heading: dict[str, Any]
    inputs: list[tuple[Path, Record | None]]
    settings_of: Callable[[Config, str | None], Any]
    simulates: bool
    check: Callable[[Config, Inputs], None] | None
    config: Config | None = None
    record: dict[str, Any] | None = None


_current_stage: ContextVar[_Stage | None] = ContextVar("stage", default=None)


@contextmanager
def record_stage(
    verb: str,
    paths: Iterable[Path],
    settings_of: Callable[[Config, str | None], Any],
    apparatus: str | None = None,
    runs: Literal["", "made", "measured"] = "",
    strategy: str | None = None,
    check: Callable[[Config, Inputs], None] | None = None,
) -> Iterator[None]:
    """Attach the record of a stage to every file that is written in the context.

    A stage is a subcommand with its settings and input files. Its record states from
    what its results were made. This function sets the current stage, a variable of this
    module. The writers of `repose.common.files` ask `get_current_record` for its
    record.

    Parameters
    ----------
    verb : str
        Name of the stage, which is that of its subcommand.
    paths : iterable of Path
        The input files of the stage.
    settings_of : callable
        Function that selects the settings that the stage reads, given a configuration
        and the name of a bench test. The name is None if the results are not runs.
    apparatus : str, optional
        The bench test of the runs. The default is the bench test in the record of the
        first input file that names one.
    runs : {"", "made", "measured"}
        Whether the results are runs that the stage simulates ("made"), runs that it
        measures ("measured"), or not runs ("").
    strategy : str, optional
        The strategy of the calibration, if the stage proposes, simulates or evaluates a
        batch of runs for it.
    check : callable, optional
        Function that is called as soon as the configuration is known, with the
        configuration and the input files with their records. It should raise InputError
        for a file of another study.

    Raises
    ------
    InputError
        If the input files do not belong together (`reject_mixture`).
    """
    inputs: list[tuple[Path, Record | None]] = [
        (path, attached.read_record(path)) for path in paths
    ]
    reject_mixture(inputs)

    # Collect the first entries of the record, which identify the stage. Only runs
    # belong to a bench test.
    heading: dict[str, Any] = {"verb": verb}
    if runs:
        heading["apparatus"] = apparatus or _first_entry(inputs, "apparatus")
    if strategy:
        heading["strategy"] = strategy

    new_stage = _Stage(
        heading,
        inputs=inputs,
        settings_of=settings_of,
        simulates=runs == "made",
        check=check,
    )
    # A stage may run inside another one, which is the current stage again afterwards.
    token = _current_stage.set(new_stage)
    try:
        yield
    finally:
        _current_stage.reset(token)


def note_config(config: Config) -> None:
    """Store the whole configuration in the current stage, if there is one.

    Files that are written after this call get a record with the settings of this
    configuration. A stage that changes its configuration must call this function again.

    Parameters
    ----------
    config : mapping
        The configuration, with all defaults filled in.

    Raises
    ------
    InputError
        If input files of the stage are results of another study.
    """
    current_stage = _current_stage.get()
    if current_stage is None:
        return
    # Only check the first configuration. Later ones are variants that the stage makes
    # itself, which may differ from that of the input files.
    if current_stage.config is None and current_stage.check is not None:
        current_stage.check(config, current_stage.inputs)
    current_stage.config = config
    # Discard the record with the earlier settings. `get_current_record` makes a new one
    # for the next file.
    current_stage.record = None


def get_current_record() -> dict[str, Any] | None:
    """Return the record of the current stage; None outside any stage."""
    current_stage = _current_stage.get()
    if current_stage is None:
        return None
    if current_stage.record is None:
        current_stage.record = _make_record(current_stage)
    return current_stage.record


def _make_record(current_stage: _Stage) -> dict[str, Any]:
    """Make the record of a stage.

    Its entry ``origin`` is a hash of the stage, its settings, the engine and the
    origins of its input files. Results with the same origin are therefore equal. Any
    change of what is hashed here changes the origin of all later results, so that they
    do not match stored ones.

    Parameters
    ----------
    current_stage : _Stage
        The stage.

    Returns
    -------
    dict
        The entries of the record.
    """
    # Simulated runs come from the current engine. Other results have the engine of
    # their input files. `reject_mixture` has checked that it is the same in all of
    # them, so take the first one.
    if current_stage.simulates:
        engine = engine_hash()
    else:
        engine = _first_entry(current_stage.inputs, "engine")

    # Select the settings that the stage reads, in the form in which a file has them.
    # They are unknown if the stage has read no configuration.
    settings = None
    seed = None
    if current_stage.config is not None:
        apparatus = current_stage.heading.get("apparatus")
        settings = convert_to_recorded_form(
            current_stage.settings_of(current_stage.config, apparatus)
        )
        seed = current_stage.config["design"]["seed"]

    # If a file has no record, the hash of its content takes the place of its origin.
    input_origins = set()
    for path, record in current_stage.inputs:
        input_origins.add(record["origin"] if record else hash_file(path))
    origin = hash_content(
        [current_stage.heading, hash_content(settings), engine, sorted(input_origins)]
    )
    return {
        **current_stage.heading,
        "settings": settings,
        "engine": engine,
        "origin": origin,
        "seed": seed,
        **describe_machine(),
    }


def convert_to_recorded_form(settings: Any) -> Any:
    """Convert settings to their form in JSON, which has lists in place of tuples."""
    return json.loads(json.dumps(settings))


def _first_entry(inputs: Inputs, key: str) -> Any:
    """Return the value of a key in the first record that has it; None if none has it."""
    for _, record in inputs:
        if record and record.get(key):
            return record[key]
    return None


def reject_mixture(inputs: Inputs) -> None:
    """Raise an InputError if input files of a stage do not belong together.

    All files must come from the same engine, the code that simulates. Runs that the
    same stage made in the same bench test become rows of one table. They must also have
    the same origin, which is a hash of their settings and input files. A file without a
    record is not checked.

    Parameters
    ----------
    inputs : iterable of (Path, mapping or None)
        Files with their records.

    Raises
    ------
    InputError
        For the first file that does not match an earlier one.
    """
    # Keep the first engine with its file, and the first origin with its file for each
    # group of runs.
    first_engine: tuple[str, Path] | None = None
    first_origins: dict[tuple[str, str], tuple[str, Path]] = {}
    for path, record in inputs:
        if record is None:
            continue

        # A result that does not depend on runs has no engine. The first file with an
        # engine is compared with itself.
        engine = record.get("engine")
        if engine:
            first_engine = first_engine or (engine, path)
            _require_same(
                path,
                key="engine",
                value=engine,
                first=first_engine,
                requirement="results of one engine",
            )

        # Only the record of a run names its bench test. Runs of one stage (`verb`) and
        # one bench test (`apparatus`) belong to the same group.
        if "apparatus" in record:
            group = (record["verb"], record["apparatus"])
            origin = record["origin"]
            first_origin = first_origins.setdefault(group, (origin, path))
            _require_same(
                path,
                key="origin",
                value=origin,
                first=first_origin,
                requirement="runs of the same settings, grain and particle",
            )


def _require_same(
    path: Path, *, key: str, value: str, first: tuple[str, Path], requirement: str
) -> None:
    """Raise InputError if a record has another value than the first one.

    Parameters
    ----------
    path : Path
        The file of the record.
    key : str
        The entry of the record.
    value : str
        Its value.
    first : (str, Path)
        The value in the first record, and the file of this record.
    requirement : str
        Description of what all files must be, for the message.
    """
    expected, source = first
    if value != expected:
        raise InputError(
            path,
            key=f"provenance.{key}",
            value=value,
            allowed=f"{expected}, as in {source}: {requirement}",
        )


# --- hashes ---------------------------------------------------------------------------


def hash_content(content: Any) -> str:
    """Hash content of JSON as 16 hexadecimal digits."""
    text = json.dumps(content, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def hash_file(path: str | PathLike) -> str:
    """Hash the content of a file as 16 hexadecimal digits."""
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()[:16]


def engine_hash() -> str:
    """Hash the code that simulates: engine, grains and bench tests."""
    return code_hash(*ENGINE_ROOMS, follow_imports=False)


# --- machine --------------------------------------------------------------------------


@cache
def describe_machine() -> dict[str, str | None]:
    """Describe the processor, the commit and the versions; unknown ones are None."""
    return {
        "repose": __version__,
        "commit": _find_commit(),
        "processor": _describe_processor(),
        "python": platform.python_version(),
        "numpy": _find_version("numpy"),
        "numba": _find_version("numba"),
    }


def _find_version(name: str) -> str | None:
    """Find the version of a library; None if it is not installed."""
    # Import this slow module only here: the help of a subcommand does not need it.
    from importlib import metadata

    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def _find_commit() -> str | None:
    """Find the commit of this program.

    Returns
    -------
    str or None
        In a checkout, the commit that git reports. In an installation, the commit that
        the build has written into a file. None if it is unknown.
    """
    root = PACKAGE.parents[1]
    is_checkout = (root / ".git").exists()
    if not is_checkout:
        built_from = places.find_program_folder() / COMMIT_FILE
        if not built_from.is_file():
            return None
        return built_from.read_text(encoding="utf-8").strip() or None

    command = ["git", "-C", str(root), "rev-parse", "--short=12", "HEAD"]
    try:
        result = subprocess.run(command, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return result.stdout.strip()


def _describe_processor() -> str:
    """Describe the processor, as far as the results may depend on it.

    The description includes the family and the model, because virtual machines use one
    name for several generations of processors. It also includes the variables of
    `FORCED_TYPES`, which make libraries use the code for another processor.
    """
    try:
        lines = CPU_INFO.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []

    # The file repeats these lines for each core. Keep those of the first core.
    fields: dict[str, str] = {}
    for line in lines:
        key, _, value = line.partition(":")
        fields.setdefault(key.strip(), value.strip())

    parts = [
        fields.get("model name") or platform.processor() or platform.machine(),
    ]
    if "cpu family" in fields:
        parts.append(f"family {fields['cpu family']}")
    if "model" in fields:
        parts.append(f"model {fields['model']}")
    for name in FORCED_TYPES:
        if os.environ.get(name):
            parts.append(f"{name}={os.environ[name]}")
    return ", ".join(parts)
