"""Run a program of the user's own: write its deck, call it, and keep what it leaves.

Each run has a folder SAMPLE/RUN with its deck, its parameters, what the program printed
(`PRINTED`) and the files that are read or kept. SAMPLE/RUN.json is the record of the
run: it is written last. A run that fails is a result with a status and a reason. The
ledger of SAMPLE lists the files of a good run that are read, so that a change is found.
"""

import json
import os
import shutil
import signal
import subprocess
import sys
import traceback
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from math import isqrt
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple

from jinja2 import DictLoader, Environment, StrictUndefined, TemplateError, meta
from jinja2.sandbox import SandboxedEnvironment

from repose.calibrate.seeds import pour_seeds
from repose.calibrate.targets import OWN
from repose.common import ledger, provenance
from repose.common.errors import InputError, YamlError, raise_together
from repose.common.files import Path_, write_json
from repose.stages.settings import SimulatorSettings

OK = "ok"
PARAMETERS = "parameters.json"
PRINTED = "printed.txt"
ABOUT = ".run.json"  # in the folder of a good run: the hash of its inputs
# Names that a template has besides those of the parameters.
NAMES = ("sample", "run", "seed", "cores")
# The name of a template in the tracebacks of Jinja2.
TEMPLATE = "<template>"
SMALLEST_PRIME_SEED = 10_007
TEMPLATE_ENDINGS = (".j2", ".jinja", ".jinja2")
# Seeds are at most this: LAMMPS takes none above 900 million.
MOST_SEED = 899_999_999
# Time between the request to end and the end [s].
GRACE_S = 10.0
# What messages expect of the program and of a named file.
EXPECTED_PROGRAM = "a program on PATH, or the path of one that may be run"
EXPECTED_FILE = "a file that is there"
# The end of what a program printed, in the reason of a failed run.
MOST_CHARACTERS = 200


class Ending(NamedTuple):
    """How a run ended; the reason is empty for ``ok``."""

    status: str
    reason: str = ""


# --- template and command -------------------------------------------------------------


def _make_environment() -> Environment:
    """Set up the templates of decks; a name that is not there is an error.

    The sandbox refuses a loop that would never end. There are no further templates: a
    run is made again only if its own template has changed.
    """
    # A deck is no HTML, so nothing in it is escaped.
    environment = SandboxedEnvironment(
        undefined=StrictUndefined, keep_trailing_newline=True, loader=DictLoader({})
    )
    environment.filters["prime"] = find_prime
    return environment


def find_prime(seed: int) -> int:
    """Find the first prime from a seed on, above 10,000: LIGGGHTS takes no other seed."""
    candidate = max(seed, SMALLEST_PRIME_SEED)
    while any(candidate % factor == 0 for factor in range(2, isqrt(candidate) + 1)):
        candidate += 1
    return candidate


def fill(text: str, values: Mapping[str, Any], source: object) -> str:
    """Fill a template.

    Raises
    ------
    InputError
        If it is no template, uses a name without a value, or computes what cannot be
        computed; it names `source` and the line.
    """
    try:
        return _make_environment().from_string(text).render(values)
    # An expression in a template is code of its author, which may raise anything.
    except Exception as error:
        place = f"{source}, line {_find_template_line(error)}"
        fault = f"{type(error).__name__}: {error}"
        names = ", ".join(values)
        allowed = f"a template of Jinja2 with the names {names}"
        raise InputError(place, "template", fault, allowed) from None


def _find_template_line(error: Exception) -> int:
    """Return the line of a template at which an error was raised."""
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if frame.filename == TEMPLATE]
    return lines[-1] or 1 if lines else 1


def find_template_names(text: str, source: object) -> set[str]:
    """Find the names that a template uses and does not define.

    Parameters
    ----------
    text : str
        The template.
    source : object
        Its file, for messages.

    Raises
    ------
    InputError
        If it is no template, or needs another one.
    """
    try:
        template = _make_environment().parse(text)
    except TemplateError as error:
        allowed = "a template of Jinja2"
        raise InputError(source, "template", str(error), allowed) from None
    # The name is None where it is computed.
    for name in meta.find_referenced_templates(template):
        allowed = "one file, without include, import or extends"
        raise InputError(source, "template", name, allowed)
    return meta.find_undeclared_variables(template)


def read_template(path: Path_) -> str:
    """Read the template of a deck.

    Raises
    ------
    InputError
        If the file is no text in UTF-8.
    """
    try:
        return Path(path).read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise InputError(path, "template", str(error), "text in UTF-8") from None


def deck_name(template: Path_) -> str:
    """Return the name of the deck: that of its template without its last ending."""
    path = Path(template)
    return path.stem if path.suffix in TEMPLATE_ENDINGS else path.name


def program_of(command: Sequence[str]) -> str | None:
    """Return the absolute path of the program; None if there is none.

    A name without a slash is looked up on `search_path`.
    """
    found = shutil.which(command[0], path=search_path())
    return None if found is None else os.path.abspath(found)


def search_path() -> str:
    """Return PATH as the jobs of the workflow have it: the Python of repose first."""
    folder = os.path.dirname(sys.executable)
    return os.pathsep.join([folder, os.environ.get("PATH", os.defpath)])


def check(
    settings: SimulatorSettings,
    parameters: Mapping[str, float],
    targets: Sequence[str],
    source: str,
    fixed: Collection[str] = (),
) -> None:
    """Check the files and names of a simulator before any run.

    Parameters
    ----------
    settings : SimulatorSettings
    parameters : mapping
        A value for each name, with which template and command are filled on trial.
    targets : sequence of str
        Their names in the study.
    source : str
        File of the configuration, for the messages.
    fixed : collection of str, optional
        The parameters of one value. A deck may hold their numbers without the names.

    Raises
    ------
    InputError
        With all faults.
    """
    raise_together(
        _find_faults(settings, parameters, targets, source=source, fixed=fixed)
    )


def _find_faults(
    settings: SimulatorSettings,
    parameters: Mapping[str, float],
    targets: Sequence[str],
    *,
    source: str,
    fixed: Collection[str],
) -> Iterator[InputError]:
    """Find the faults that `check` raises; its parameters are the same."""
    if program_of(settings.command) is None:
        key = "simulator.command.0"
        yield YamlError(source, key, settings.command[0], EXPECTED_PROGRAM)

    missing = [name for name in _list_study_files(settings) if not Path(name).is_file()]
    for name in missing:
        key = "simulator.template" if name == settings.template else "simulator.files"
        yield YamlError(source, key, name, EXPECTED_FILE)
    yield from _find_file_faults(settings, source)

    # Parameters must not have the names of numbers that each run has.
    for name in NAMES:
        if name in parameters:
            allowed = f"another name: {', '.join(NAMES)} are numbers of the run itself"
            yield YamlError(source, f"parameters.{name}", name, allowed)

    # A template that is missing was reported above, and cannot be read.
    if settings.template not in missing:
        yield from _find_name_faults(settings, parameters, source=source, fixed=fixed)

    # Without a table of responses, all of them come from the pile of particles.
    if settings.output is None:
        pile_responses = responses_of_pile()
        for name in targets:
            if name not in pile_responses:
                allowed = (
                    f"one of {', '.join(pile_responses)}, which a file of particles gives, or "
                    "`simulator.output` with the table that has it"
                )
                yield YamlError(source, f"targets.{name}", name, allowed)


def _find_file_faults(settings: SimulatorSettings, source: str) -> Iterator[InputError]:
    """Find files that would have the same name in the folder of a run.

    Yields
    ------
    InputError
        For two inputs of the same name, and for an output with the name of an input.
    """
    for name in _find_repeated_names(settings):
        allowed = "files whose names differ in the folder of a run"
        yield YamlError(source, "simulator.files", name, allowed)
    # A program that failed to write would leave the file that it was given.
    input_names = _list_input_files(settings)
    for key, name in settings.files_by_key.items():
        if name in input_names:
            allowed = "a file that the run writes, not one that it is given"
            yield YamlError(source, f"simulator.{key}", name, allowed)


def _find_name_faults(
    settings: SimulatorSettings,
    parameters: Mapping[str, float],
    *,
    source: str,
    fixed: Collection[str],
) -> Iterator[InputError]:
    """Find unknown names in template and command, and parameters that are not used.

    Parameters
    ----------
    settings : SimulatorSettings
    parameters : mapping
        A value for each parameter, with which template and command are filled on trial.
    source : str
        File of the configuration, for the messages.
    fixed : collection of str
        Parameters of one value, which may be unused.

    Yields
    ------
    InputError
    """
    known = (*parameters, *NAMES)
    used: set[str] = set()
    for place, text in _read_templates(settings, source).items():
        names_in_text = find_template_names(text, place)
        used |= names_in_text
        unknown = sorted(names_in_text.difference(known))
        for name in unknown:
            yield InputError(place, "name", name, f"one of {', '.join(known)}")
        # With all names known, filling shows whether its expressions can be computed.
        if not unknown:
            yield from _try_to_fill(text, parameters, place)
    # Without a template the program reads all parameters from a file.
    if settings.template is None:
        return
    for name in parameters:
        if name not in used and name not in fixed:
            allowed = f"a name that {settings.template} or the command uses"
            yield YamlError(source, f"parameters.{name}", name, allowed)


def names_in_deck(settings: SimulatorSettings) -> set[str]:
    """Return the names that the template and the command of a simulator use."""
    texts = _read_templates(settings, "configuration")
    return set().union(
        *(find_template_names(text, place) for place, text in texts.items())
    )


def _read_templates(settings: SimulatorSettings, source: str) -> dict[str, str]:
    """Return the command and the template, by their place in messages."""
    texts = {f"{source}, simulator.command": "\n".join(settings.command)}
    if settings.template is not None:
        texts[settings.template] = read_template(settings.template)
    return texts


def _try_to_fill(
    text: str, parameters: Mapping[str, float], place: str
) -> Iterator[InputError]:
    """Yield the fault of a template that cannot be filled for a first run."""
    try:
        fill(text, {**parameters, **dict.fromkeys(NAMES, 1)}, place)
    except InputError as error:
        yield error


def _list_study_files(settings: SimulatorSettings) -> tuple[str, ...]:
    """List the files that a study names for its runs."""
    template = () if settings.template is None else (settings.template,)
    return (*template, *settings.files)


def _list_input_files(settings: SimulatorSettings) -> list[str]:
    """List the names of the files that a run finds in its folder."""
    names = [PARAMETERS, *(Path(name).name for name in settings.files)]
    if settings.template is not None:
        names.append(deck_name(settings.template))
    return names


def _find_repeated_names(settings: SimulatorSettings) -> list[str]:
    """List the names that two files of a run's folder would have."""
    names = [PRINTED, *_list_input_files(settings)]
    return sorted({name for name in names if names.count(name) > 1})


def responses_of_pile() -> tuple[str, ...]:
    """List the responses that a file of particles gives."""
    from repose.measure.definitions import MEAN_KEYS

    return ("aor_deg", "height_mm", *MEAN_KEYS.values())


# --- a run ----------------------------------------------------------------------------


def seed_of(study_seed: int, purpose: str, sample: int, run: int) -> int:
    """Draw the seed of a run: a number from 1 to `MOST_SEED`."""
    seeds = pour_seeds(study_seed, purpose, sample, run, apparatus=OWN)
    return 1 + seeds[-1] % MOST_SEED


def run_once(
    settings: SimulatorSettings,
    parameters: Mapping[str, float],
    *,
    sample: int,
    run: int,
    seed: int,
    out_dir: Path_,
) -> dict[str, Any]:
    """Run the program once, and write the record of the run.

    A finished run with the same inputs is not made again.

    Parameters
    ----------
    settings : SimulatorSettings
    parameters : mapping
        Values by name.
    sample, run, seed : int
        Numbers of the sample and of its run, and its seed.
    out_dir : path
        The folder of the sample; RUN.json is the record.

    Returns
    -------
    dict
        The content of the record.

    Raises
    ------
    InputError
        If the program or a file is missing, or the template uses an unknown name.
    """
    values = {
        **parameters,
        "sample": sample,
        "run": run,
        "seed": seed,
        "cores": settings.cores,
    }
    out = Path(out_dir)
    inputs = _collect_inputs(settings, values)
    run_folder = out / str(run)
    # A failed run is made again, since its cause may be repaired.
    ending = _find_finished_run(run_folder, inputs, settings)
    if ending is None:
        ending = _run_in_folder(settings, inputs, run_folder)
    record = {
        "apparatus": OWN,
        "sample": sample,
        "run": run,
        "seed": seed,
        "parameters": dict(parameters),
        "command": inputs["command"],
        **ending._asdict(),
    }
    write_json(out / f"{run}.json", record)
    return record


def _collect_inputs(
    settings: SimulatorSettings, values: Mapping[str, Any]
) -> dict[str, Any]:
    """Collect all that a run depends on.

    Parameters
    ----------
    settings : SimulatorSettings
    values : mapping
        Values of the names that template and command may use.

    Returns
    -------
    dict
        The filled command and deck, the path of the program, the values, the hash of
        each file by its name, and the names of the files that are read or kept.

    Raises
    ------
    InputError
        If the program or a file is missing, or a name is unknown.
    """
    command = [fill(part, values, "simulator.command") for part in settings.command]
    program = program_of(command)
    if program is None:
        raise InputError("simulator", "command", command[0], EXPECTED_PROGRAM)
    deck = None
    if settings.template is not None:
        text = read_template(settings.template)
        deck = fill(text, values, settings.template)
    # Files are compared by their content.
    hashes = {}
    for name in settings.files:
        if not Path(name).is_file():
            raise InputError("simulator", "files", name, EXPECTED_FILE)
        hashes[Path(name).name] = provenance.hash_of_file(name)
    return {
        "command": command,
        "program": program,
        "deck": deck,
        "values": dict(values),
        "files": hashes,
        "read": [*settings.files_read, *settings.keep],
    }


def _find_finished_run(
    folder: Path, inputs: Mapping[str, Any], settings: SimulatorSettings
) -> Ending | None:
    """Return the ending of a finished good run with the same inputs.

    Parameters
    ----------
    folder : Path
        Folder of the run, which may not exist.
    inputs : mapping
        Result of `_collect_inputs`.
    settings : SimulatorSettings
        Names the files that must be there.

    Returns
    -------
    Ending or None
        None if the run must be made.
    """
    try:
        stored_hash = json.loads((folder / ABOUT).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    is_same = stored_hash == _hash_inputs(inputs)
    is_whole = not any(fault_of_file(folder, name) for name in settings.files_read)
    return Ending(OK) if is_same and is_whole else None


def fault_of_file(folder: Path, name: str) -> InputError | None:
    """Find what is wrong with a file that a good run left.

    Parameters
    ----------
    folder : Path
        Of the run; the ledger of the folder around it lists the file.
    name : str
        One of `SimulatorSettings.files_read`.

    Returns
    -------
    InputError or None
        The fault, with what to remove so that the run is made again.
    """
    path = folder / name
    if not path.is_file():
        words = f"the file of this run; remove {folder}.json, and run again"
        return InputError(path, "file", "lost", words)
    if ledger.is_changed(folder.parent, f"{folder.name}/{name}"):
        words = (
            "the file as this run left it; remove it, which is damaged or edited, and "
            f"{folder}.json, and run again"
        )
        return InputError(path, "content", "something else", words)
    return None


def _hash_inputs(inputs: Mapping[str, Any]) -> dict[str, str]:
    """Make the content of the file `ABOUT`: the hash of a run's inputs."""
    return {"inputs": provenance.hash_of(dict(inputs))}


def _run_in_folder(
    settings: SimulatorSettings,
    inputs: Mapping[str, Any],
    folder: Path,
) -> Ending:
    """Run the program in a temporary folder, which is renamed at the end.

    A folder with the final name is therefore complete.

    Parameters
    ----------
    settings : SimulatorSettings
    inputs : mapping
        Result of `_collect_inputs`.
    folder : Path
        The final name. A folder of this name is replaced.

    Returns
    -------
    Ending
    """
    work = folder.with_name(f"{folder.name}.part")
    # An interrupted run may have left this folder.
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    _write_inputs(settings, inputs, work)
    command = [inputs["program"], *inputs["command"][1:]]
    ending = _call_program(command, work, settings)
    # A program may remove its own folder; it then left nothing.
    work.mkdir(exist_ok=True)
    if ending.status == OK:
        ending = _check_outputs(settings, work)

    _remove_unlisted_files(work, settings)
    # Only a good run is taken again: what made another one fail may be repaired.
    if ending.status == OK:
        (work / ABOUT).write_text(json.dumps(_hash_inputs(inputs)), encoding="utf-8")
        for name in settings.files_read:
            listed = f"{folder.name}/{name}"
            ledger.adopt_below(folder.parent, listed, source=work / name)
    shutil.rmtree(folder, ignore_errors=True)
    os.replace(work, folder)
    return ending


def _write_inputs(
    settings: SimulatorSettings, inputs: Mapping[str, Any], work: Path
) -> None:
    """Copy the files of a run to its folder, and write its deck and parameters.

    Parameters
    ----------
    settings : SimulatorSettings
    inputs : mapping
        Result of `_collect_inputs`.
    work : Path
        An empty folder.
    """
    for name in settings.files:
        shutil.copy(name, work / Path(name).name)
    if settings.template is not None:
        deck = work / deck_name(settings.template)
        deck.write_text(inputs["deck"], encoding="utf-8")
    # What numbers and equips the run stands beside its parameters.
    values = inputs["values"]
    run_numbers = {name: values[name] for name in NAMES}
    parameters = {name: value for name, value in values.items() if name not in NAMES}
    text = json.dumps({**run_numbers, "parameters": parameters}, indent=1)
    (work / PARAMETERS).write_text(f"{text}\n", encoding="utf-8")


def _check_outputs(settings: SimulatorSettings, work: Path) -> Ending:
    """Tell whether a program that ended well has left every file that is read."""
    for name in settings.files_read:
        path = work / name
        if not path.exists():
            return Ending("no_output", f"{name} is missing")
        if not path.is_file():
            return Ending("no_output", f"{name} is no file")
    return Ending(OK)


def _call_program(
    command: Sequence[str], work: Path, settings: SimulatorSettings
) -> Ending:
    """Call the program in a folder, without a shell, and wait for its end.

    What it prints goes to the file `PRINTED`. If it takes too long, or if this process
    is asked to end, the program is stopped with all its children.

    Parameters
    ----------
    command : sequence of str
        Path of the program, and its arguments.
    work : Path
        The folder.
    settings : SimulatorSettings
        Time limit and number of cores.

    Returns
    -------
    Ending
    """
    # Libraries with threads of their own read OMP_NUM_THREADS.
    environment_changes = {
        "PATH": search_path(),
        "OMP_NUM_THREADS": str(settings.cores),
    }
    with open(work / PRINTED, "wb") as printed, _exit_on_sigterm():
        process = subprocess.Popen(
            command,
            cwd=work,
            stdin=subprocess.DEVNULL,
            stdout=printed,
            stderr=subprocess.STDOUT,
            env={**os.environ, **environment_changes},
            # Its children end with it, as they are of its own group.
            start_new_session=True,
        )
        try:
            process.wait(settings.time_limit_s)
        except subprocess.TimeoutExpired:
            _stop_program(process)
            return Ending("time_limit", f"longer than {settings.time_limit_s:g} s")
        except BaseException:
            _stop_program(process)
            raise
    if process.returncode == 0:
        return Ending(OK)
    cause = f"exit status {process.returncode}"
    # The negative status is the number of the signal that ended the program.
    if process.returncode < 0:
        cause = f"ended by {signal.Signals(-process.returncode).name}"
    last_line = _read_last_line(work / PRINTED)
    return Ending("exit_status", f"{cause}: {last_line}" if last_line else cause)


@contextmanager
def _exit_on_sigterm() -> Iterator[None]:
    """Let the signal SIGTERM raise SystemExit within this context.

    By default the signal would end this process at once, and leave the called program
    running. The previous handler is restored at the end.
    """

    def raise_exit(number: int, frame: FrameType | None) -> None:
        raise SystemExit(128 + number)

    previous_handler = signal.signal(signal.SIGTERM, raise_exit)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, previous_handler)


def _stop_program(process: "subprocess.Popen[bytes]") -> None:
    """Stop a program with all its children.

    It first gets the request SIGTERM. If it still runs after `GRACE_S`, SIGKILL ends
    it.

    Parameters
    ----------
    process : subprocess.Popen
        The program, which leads a process group of its own.
    """
    for signal_number in (signal.SIGTERM, signal.SIGKILL):
        try:
            os.killpg(process.pid, signal_number)
        except ProcessLookupError:
            # All processes of the group have ended.
            break
        try:
            process.wait(GRACE_S)
        except subprocess.TimeoutExpired:
            continue


def _read_last_line(path: Path) -> str:
    """Return the last line that a program printed, shortened."""
    if not path.is_file():
        return ""
    text = path.read_text(encoding="utf-8", errors="replace").rstrip()
    line = text.rpartition("\n")[2].strip()
    return "".join(filter(str.isprintable, line))[-MOST_CHARACTERS:]


def _remove_unlisted_files(work: Path, settings: SimulatorSettings) -> None:
    """Remove the files of a run that are neither read nor kept, and empty folders.

    Parameters
    ----------
    work : Path
        Folder of the run.
    settings : SimulatorSettings
        Lists the files that are read or kept.
    """
    kept_names = {PARAMETERS, PRINTED, *settings.files_read, *settings.keep}
    if settings.template is not None:
        kept_names.add(deck_name(settings.template))
    # In reverse order, the content of a folder comes before the folder.
    for path in sorted(work.rglob("*"), reverse=True):
        if path.is_dir() and not path.is_symlink():
            if not any(path.iterdir()):
                path.rmdir()
        elif str(path.relative_to(work)) not in kept_names:
            path.unlink()
