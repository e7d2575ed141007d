"""Provenance: the origin of a result, written with it.

A stage is one verb with its settings and the files that it reads. While it runs, the writers of `repose.common.files` put
its record into every file; a user's own program has no stage, so its files have no record. docs/howto.md explains the
entries.
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
from repose.common.errors import InputError, require
from repose.common.places import PACKAGE
from repose.common.source_code import code_hash

# A pour depends on the simulator, the bench tests and the grains.
ENGINE = ("dem", "grain", "bench")
CPU_INFO = Path("/proc/cpuinfo")
BUILT_FROM = "commit.txt"  # beside the program's other data; a build writes it
# With these set, numba compiles and numpy calculates as on another type of processor, with other last bits.
FORCED_TYPES = ("NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES", "OPENBLAS_CORETYPE")


@dataclass
class _Stage:
    """The current verb, the records of its files, and the choice of its settings from the configuration."""

    about: dict[str, Any]
    inputs: list[tuple[Path, dict[str, Any] | None]]
    settings_of: Callable[[Mapping[str, Any], str | None], Any]
    config: Mapping[str, Any] | None = None
    record: dict[str, Any] | None = None
    simulates: bool = False


_stage: ContextVar[_Stage | None] = ContextVar("stage", default=None)


@contextmanager
def stage(
    verb: str,
    paths: Iterable[Path],
    settings_of: Callable[[Mapping[str, Any], str | None], Any],
    apparatus: str | None = None,
    runs: Literal["", "made", "measured"] = "",
    strategy: str | None = None,
) -> Iterator[None]:
    """Write the record of a stage with the input files `paths` into every file that is written meanwhile.

    `runs` says whether its results are runs of a bench test that it makes by the simulator, or measures; `apparatus`
    None is the bench test of the input files. `strategy` is that which a stage of its batches serves.
    """
    inputs = [(path, attached.read(path)) for path in paths]
    refuse_mixture(inputs)
    if runs and apparatus is None:
        named = (record.get("apparatus") for _, record in inputs if record)
        apparatus = next(filter(None, named), None)
    about = {"verb": verb} | ({"apparatus": apparatus} if runs else {})
    about |= {"strategy": strategy} if strategy else {}
    token = _stage.set(_Stage(about, inputs, settings_of, simulates=runs == "made"))
    try:
        yield
    finally:
        _stage.reset(token)


def note_config(config: Mapping[str, Any]) -> None:
    """Give the current stage, if there is one, its whole configuration."""
    running = _stage.get()
    if running is not None:
        running.config, running.record = config, None


def current() -> dict[str, Any] | None:
    """Return the record of the current stage; None without one."""
    running = _stage.get()
    if running is not None and running.record is None:
        running.record = _record(running)
    return running.record if running else None


def _record(running: _Stage) -> dict[str, Any]:
    """Make the record of a stage."""
    engines = [
        record["engine"]
        for _, record in running.inputs
        if record and record.get("engine")
    ]
    engine = engine_hash() if running.simulates else next(iter(engines), None)
    config, seed = running.config, None
    if config is not None:
        config, seed = (
            running.settings_of(config, running.about.get("apparatus")),
            config["design"]["seed"],
        )
    settings = hash_of(config)
    origins = sorted(
        {
            record["origin"] if record else hash_of_file(path)
            for path, record in running.inputs
        }
    )
    origin = hash_of([running.about, settings, engine, origins])
    return (
        running.about
        | {"settings": settings, "engine": engine, "origin": origin, "seed": seed}
        | machine()
    )


def refuse_mixture(inputs: Iterable[tuple[Path, Mapping[str, Any] | None]]) -> None:
    """Raise InputError for results of two engines, or runs of two origins; a file without a record goes with any."""
    engines: dict[str, Path] = {}
    origins: dict[tuple, tuple[str, Path]] = {}
    for path, record in inputs:
        if record is None:
            continue
        engine = record.get("engine")
        if engine and engines.setdefault(engine, path) == path and len(engines) > 1:
            other, where = next(iter(engines.items()))
            raise InputError(
                path,
                "provenance.engine",
                engine,
                f"{other}, as in {where}: results of one engine",
            )
        if "apparatus" in record:  # runs, which are rows of one table
            kind = (record["verb"], record["apparatus"])
            origin, where = origins.setdefault(kind, (record["origin"], path))
            allowed = f"{origin}, as in {where}: runs of the same settings, grain and particle"
            require(
                origin == record["origin"],
                path,
                "provenance.origin",
                record["origin"],
                allowed,
            )


def hash_of(content: Any) -> str:
    """Hash content that JSON can hold; 16 hexadecimal digits."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]


def hash_of_file(path: str | PathLike) -> str:
    """Hash a file's content; 16 hexadecimal digits."""
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()[:16]


def engine_hash() -> str:
    """Hash the code that simulates: engine, grains and bench tests."""
    return code_hash(*ENGINE, follow_imports=False)


@cache
def machine() -> dict[str, str | None]:
    """Find the versions, the commit (None where it is not known) and the processor type."""
    return {
        "repose": __version__,
        "commit": _commit(),
        "processor": _processor(),
        "python": platform.python_version(),
        **{name: _version(name) for name in ("numpy", "numba")},
    }


def _version(name: str) -> str | None:
    """Tell the version of a library; None where it is not installed."""
    from importlib import (
        metadata,
    )  # slow to import, which the help of a verb should avoid

    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None


def _commit() -> str | None:
    """Find the commit of the checkout, or the one that the package was built from; None if neither is known."""
    root, noted = PACKAGE.parents[1], places.root() / BUILT_FROM
    if not (root / ".git").exists():
        return (
            noted.read_text(encoding="utf-8").strip() or None
            if noted.is_file()
            else None
        )
    words = ["git", "-C", str(root), "rev-parse", "--short=12", "HEAD"]
    try:
        return subprocess.run(
            words, capture_output=True, text=True, check=True
        ).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return None


def _processor() -> str:
    """Describe the processor: name, family, model, and settings that compile or calculate for another type."""
    try:
        lines = CPU_INFO.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    fields: dict[str, str] = {}
    for line in lines:
        key, _, value = line.partition(":")
        fields.setdefault(key.strip(), value.strip())
    name = fields.get("model name") or platform.processor() or platform.machine()
    # a virtual machine may call several generations by one name
    numbers = [
        f"{key.rpartition(' ')[2]} {fields[key]}"
        for key in ("cpu family", "model")
        if key in fields
    ]
    return ", ".join(
        [
            name,
            *numbers,
            *[
                f"{key}={os.environ[key]}"
                for key in FORCED_TYPES
                if os.environ.get(key)
            ],
        ]
    )
