"""Run the user's own program: write its input script, call it, and keep its files.

Each run has a folder SAMPLE/RUN with its input script (which the documentation calls
deck), its parameters, what the program printed (`PRINTED_FILE`) and the files that are
read or kept. SAMPLE/RUN.json is the record of the run, and is written last. A run that
fails is also a result, with a status and a reason. The folder SAMPLE has a hidden list
of its files with their hashes, the ledger. It lists the output files of a good run, so
that later changes to them are noticed.
"""

import json
import os
import shutil
import signal
import subprocess
import sys
import traceback
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from math import isqrt
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple

from jinja2 import DictLoader, Environment, StrictUndefined, TemplateError, meta
from jinja2.sandbox import SandboxedEnvironment

from repose.calibrate.seeds import draw_run_seeds
from repose.calibrate.targets import OWN_BENCH
from repose.common import ledger, provenance
from repose.common.errors import InputError, YamlError, raise_together
from repose.common.files import StrPath, write_json
from repose.stages.settings import SimulatorSettings

OK = "ok"
PARAMETERS_FILE = "parameters.json"
PRINTED_FILE = "printed.txt"
INPUT_HASH_FILE = ".run.json"  # in the folder of a good run: the hash of its inputs
# Names that a template may use besides those of the parameters.
RUN_VARIABLES = ("sample", "run", "seed", "cores")
# Name that the tracebacks of Jinja2 give to the file of a template.
JINJA_FILE_NAME = "<template>"
# LIGGGHTS takes only prime seeds above 10,000. This is the first one.
SMALLEST_PRIME_SEED = 10_007
TEMPLATE_ENDINGS = (".j2", ".jinja", ".jinja2")
# LAMMPS takes no seed above 900 million.
HIGHEST_SEED = 899_999_999
# Time that a program has to end after SIGTERM [s].
STOP_TIME_S = 10.0
# What error messages expect of the program and of a named file.
EXPECTED_PROGRAM = "a program on PATH, or the path of one that may be run"
EXPECTED_FILE = "an existing file"
# Largest number of characters that the reason of a failed run quotes from the last
# line.
MAX_REASON_LENGTH = 200


class Outcome(NamedTuple):
    """How a run ended; the reason is empty for ``ok``."""

    status: str
    reason: str = ""


# --- template and command -------------------------------------------------------------


def _make_environment() -> Environment:
    """Make the Jinja2 environment for the templates of input scripts.

    A name without a value is an error. The sandbox refuses a loop that would never end.
    A template cannot load another file, because a run is only made again if its own
    template has changed.
    """
    # Do not escape special characters, because an input script is not HTML.
    environment = SandboxedEnvironment(
        undefined=StrictUndefined, keep_trailing_newline=True, loader=DictLoader({})
    )
    environment.filters["prime"] = find_prime
    return environment


def find_prime(seed: int) -> int:
    """Find the smallest prime that is at least the seed and `SMALLEST_PRIME_SEED`."""
    candidate = max(seed, SMALLEST_PRIME_SEED)
    while any(candidate % factor == 0 for factor in range(2, isqrt(candidate) + 1)):
        candidate += 1
    return candidate


def fill_template(text: str, values: Mapping[str, Any], source: object) -> str:
    """Fill a Jinja2 template.

    Parameters
    ----------
    text : str
        The template.
    values : mapping
        Values of the names that the template may use.
    source : object
        File of the template, for messages.

    Raises
    ------
    InputError
        If the text is not a template, uses a name without a value, or has an expression
        that fails. The error names `source` and the line.
    """
    try:
        return _make_environment().from_string(text).render(values)
    # An expression in a template may raise any exception.
    except Exception as error:
        names = ", ".join(values)
        raise InputError(
            f"{source}, line {_find_template_line(error)}",
            key="template",
            value=f"{type(error).__name__}: {error}",
            allowed=f"a template of Jinja2 with the names {names}",
        ) from None


def _find_template_line(error: Exception) -> int:
    """Find the line of a template at which an error was raised; 1 if it is unknown."""
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if frame.filename == JINJA_FILE_NAME]
    return lines[-1] or 1 if lines else 1


def find_undefined_names(text: str, source: object) -> set[str]:
    """Find the names that a Jinja2 template uses and does not define itself.

    Parameters
    ----------
    text : str
        The template.
    source : object
        Its file, for messages.

    Returns
    -------
    set of str
        The names, such as those of parameters, for which values must be given.

    Raises
    ------
    InputError
        If the text is not a template, or if it includes another file. The error names
        the first of these files.
    """
    try:
        template = _make_environment().parse(text)
    except TemplateError as error:
        raise InputError(
            source, key="template", value=str(error), allowed="a template of Jinja2"
        ) from None
    # The name of an included file is None if an expression computes it.
    included_files = list(meta.find_referenced_templates(template))
    if included_files:
        raise InputError(
            source,
            key="template",
            value=included_files[0],
            allowed="one file, without include, import or extends",
        )
    return meta.find_undeclared_variables(template)


def read_template(path: StrPath) -> str:
    """Read the template of an input script.

    Raises
    ------
    InputError
        If the file is not text in UTF-8.
    """
    try:
        return Path(path).read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise InputError(
            path, key="template", value=str(error), allowed="text in UTF-8"
        ) from None


def deck_name(template: StrPath) -> str:
    """Return the name of an input script, that of its template without `.j2`.

    All `TEMPLATE_ENDINGS` are removed.
    """
    path = Path(template)
    return path.stem if path.suffix in TEMPLATE_ENDINGS else path.name


def find_program(command: Sequence[str]) -> str | None:
    """Find the absolute path of a program; None if there is no such program.

    A name without a slash is searched in the folders of `make_search_path`.
    """
    program = shutil.which(command[0], path=make_search_path())
    return None if program is None else os.path.abspath(program)


def make_search_path() -> str:
    """Make the PATH of the called program, with the folder of this Python first."""
    folder = os.path.dirname(sys.executable)
    return os.pathsep.join([folder, os.environ.get("PATH", os.defpath)])


def check_simulator(
    settings: SimulatorSettings,
    parameters: Mapping[str, float],
    targets: Sequence[str],
    source: str,
    fixed_names: Collection[str] = (),
) -> None:
    """Check the files and names of a simulator before any run.

    Parameters
    ----------
    settings : SimulatorSettings
        The section `simulator`.
    parameters : mapping
        A value for each name. As a test, template and command are filled with them.
    targets : sequence of str
        Names of the targets in the study.
    source : str
        File of the configuration, for the messages.
    fixed_names : collection of str, optional
        Names of the parameters with a single value. An input script may state their
        numbers directly and not use the names.

    Raises
    ------
    InputError
        With all problems that were found.
    """
    raise_together(
        _find_problems(
            settings, parameters, targets, source=source, fixed_names=fixed_names
        )
    )


def _find_problems(
    settings: SimulatorSettings,
    parameters: Mapping[str, float],
    targets: Sequence[str],
    *,
    source: str,
    fixed_names: Collection[str],
) -> Iterator[InputError]:
    """Find all problems with the files and names of a simulator.

    The problems are yielded one after the other, for `check_simulator` to raise them
    together.

    Parameters
    ----------
    settings : SimulatorSettings
        The section `simulator`.
    parameters : mapping
        A value for each name, with which template and command are filled as a test.
    targets : sequence of str
        Names of the targets in the study.
    source : str
        File of the configuration, for the messages.
    fixed_names : collection of str
        Names of the parameters with a single value, which need not be used.

    Yields
    ------
    YamlError or InputError
        YamlError for a value of the configuration, and InputError for a template.
    """
    if find_program(settings.command) is None:
        yield YamlError(
            source,
            # The program is the first part of the command.
            key="simulator.command.0",
            value=settings.command[0],
            allowed=EXPECTED_PROGRAM,
        )

    missing_files = [
        name for name in _list_study_files(settings) if not Path(name).is_file()
    ]
    for name in missing_files:
        key = "simulator.template" if name == settings.template else "simulator.files"
        yield YamlError(source, key=key, value=name, allowed=EXPECTED_FILE)
    yield from _find_equal_file_names(settings, source)

    yield from _find_reserved_names(parameters, source)
    # A missing template was reported above, and cannot be read. Without a template,
    # `settings.template` is None, which is not among the missing files, and only the
    # command is checked.
    if settings.template not in missing_files:
        yield from _check_names_and_expressions(settings, parameters, source)
        # Without a template the program reads all parameters from a file.
        if settings.template is not None:
            yield from _find_unused_parameters(
                settings, parameters, source=source, fixed_names=fixed_names
            )
    yield from _find_unknown_targets(settings, targets, source)


def _find_reserved_names(
    parameters: Iterable[str], source: str
) -> Iterator[InputError]:
    """Find parameters that have the name of a number of the run, such as its seed."""
    reserved_names = ", ".join(RUN_VARIABLES)
    for name in RUN_VARIABLES:
        if name in parameters:
            yield YamlError(
                source,
                key=f"parameters.{name}",
                value=name,
                allowed=f"another name: {reserved_names} are numbers of the run itself",
            )


def _find_unknown_targets(
    settings: SimulatorSettings, targets: Iterable[str], source: str
) -> Iterator[InputError]:
    """Find targets whose response is in no file of a run.

    A table of responses may have any column. Without this table, all responses come
    from the pile of particles.
    """
    if settings.output is not None:
        return
    pile_responses = list_pile_responses()
    for name in targets:
        if name not in pile_responses:
            yield YamlError(
                source,
                key=f"targets.{name}",
                value=name,
                allowed=(
                    f"one of {', '.join(pile_responses)}, which a file of particles "
                    "gives, or `simulator.output` with the table that has it"
                ),
            )


def _find_equal_file_names(
    settings: SimulatorSettings, source: str
) -> Iterator[InputError]:
    """Find files that would have the same name in the folder of a run.

    Yields
    ------
    YamlError
        For two inputs with the same name, and for an output with the name of an input.
    """
    for name in _find_repeated_names(settings):
        yield YamlError(
            source,
            key="simulator.files",
            value=name,
            allowed="files whose names differ in the folder of a run",
        )
    # If the program wrote no output, an input of the same name would be read instead.
    input_names = _list_input_files(settings)
    for key, name in settings.files_by_key.items():
        if name in input_names:
            yield YamlError(
                source,
                key=f"simulator.{key}",
                value=name,
                allowed="a file that the run writes, not one that it is given",
            )


def _check_names_and_expressions(
    settings: SimulatorSettings, parameters: Mapping[str, float], source: str
) -> Iterator[InputError]:
    """Find unknown names in template and command, and expressions that fail.

    Parameters
    ----------
    settings : SimulatorSettings
        The section `simulator`.
    parameters : mapping
        A value for each parameter. Template and command are filled with these values to
        test their expressions.
    source : str
        File of the configuration, for the messages.

    Yields
    ------
    InputError
        One for each unknown name, or for an expression that fails.
    """
    known_names = (*parameters, *RUN_VARIABLES)
    for place, text in _read_templates(settings, source).items():
        names = find_undefined_names(text, place)
        unknown_names = sorted(names.difference(known_names))
        for name in unknown_names:
            yield InputError(
                place,
                key="name",
                value=name,
                allowed=f"one of {', '.join(known_names)}",
            )
        # If all names are known, fill the text to test whether its expressions can be
        # computed.
        if not unknown_names:
            yield from _try_to_fill(text, parameters, place)


def _find_unused_parameters(
    settings: SimulatorSettings,
    parameters: Iterable[str],
    *,
    source: str,
    fixed_names: Collection[str],
) -> Iterator[InputError]:
    """Find parameters that neither the template nor the command uses.

    Parameters
    ----------
    settings : SimulatorSettings
        The simulator, which has a template.
    parameters : iterable of str
        Names of the parameters.
    source : str
        File of the configuration, for the messages.
    fixed_names : collection of str
        Names of the parameters with a single value, which need not be used.
    """
    used_names = find_used_names(settings)
    for name in parameters:
        if name not in used_names and name not in fixed_names:
            yield YamlError(
                source,
                key=f"parameters.{name}",
                value=name,
                allowed=f"a name that {settings.template} or the command uses",
            )


def find_used_names(settings: SimulatorSettings) -> set[str]:
    """Find the names that the template and the command of a simulator use."""
    texts = _read_templates(settings, "configuration")
    return set().union(
        *(find_undefined_names(text, place) for place, text in texts.items())
    )


def _read_templates(settings: SimulatorSettings, source: str) -> dict[str, str]:
    """Return the content of command and template, by the place that messages name."""
    texts = {f"{source}, simulator.command": "\n".join(settings.command)}
    if settings.template is not None:
        texts[settings.template] = read_template(settings.template)
    return texts


def _try_to_fill(
    text: str, parameters: Mapping[str, float], place: str
) -> Iterator[InputError]:
    """Fill a template as a test, and yield the error if this fails.

    `place` states where the text is, for the message. All numbers of the run are 1.
    """
    try:
        fill_template(text, {**parameters, **dict.fromkeys(RUN_VARIABLES, 1)}, place)
    except InputError as error:
        yield error


def _list_study_files(settings: SimulatorSettings) -> tuple[str, ...]:
    """List the files that a study names for its runs."""
    template = () if settings.template is None else (settings.template,)
    return (*template, *settings.files)


def _list_input_files(settings: SimulatorSettings) -> list[str]:
    """List the names of the files that a run finds in its folder."""
    names = [PARAMETERS_FILE, *(Path(name).name for name in settings.files)]
    if settings.template is not None:
        names.append(deck_name(settings.template))
    return names


def _find_repeated_names(settings: SimulatorSettings) -> list[str]:
    """List the names that more than one file in the folder of a run would have."""
    names = [PRINTED_FILE, *_list_input_files(settings)]
    return sorted({name for name in names if names.count(name) > 1})


def list_pile_responses() -> tuple[str, ...]:
    """List the responses that can be measured from a file of particles."""
    from repose.measure.definitions import MEAN_KEYS

    return ("aor_deg", "height_mm", *MEAN_KEYS.values())


# --- a run ----------------------------------------------------------------------------


def draw_seed(study_seed: int, purpose: str, sample: int, run: int) -> int:
    """Draw the seed of a run: a number from 1 to `HIGHEST_SEED`."""
    # The run with number k has the k-th seed of its sample.
    seeds = draw_run_seeds(study_seed, purpose, sample, run, apparatus=OWN_BENCH)
    return 1 + seeds[-1] % HIGHEST_SEED


def run_once(
    settings: SimulatorSettings,
    parameters: Mapping[str, float],
    *,
    sample: int,
    run: int,
    seed: int,
    out_dir: StrPath,
) -> dict[str, Any]:
    """Run the program once, and write the record of the run.

    If a good run with the same inputs exists, its files are used again.

    Parameters
    ----------
    settings : SimulatorSettings
        The section `simulator`.
    parameters : mapping
        Values by name.
    sample, run, seed : int
        Number of the sample, number of the run in it, and seed of the run.
    out_dir : path
        The folder of the sample. The record is its file RUN.json, where RUN is the
        number of the run.

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
    # Use a finished good run again. A failed run is always made again, because the user
    # may have repaired the cause.
    outcome = _find_finished_run(run_folder, inputs, settings)
    if outcome is None:
        outcome = _run_in_folder(settings, inputs, run_folder)
    record = {
        # The key `apparatus` names the bench test. `OWN_BENCH` stands for the user's
        # own program.
        "apparatus": OWN_BENCH,
        "sample": sample,
        "run": run,
        "seed": seed,
        "parameters": dict(parameters),
        "command": inputs["command"],
        # The keys `status` and `reason`.
        **outcome._asdict(),
    }
    write_json(out / f"{run}.json", record)
    return record


def _collect_inputs(
    settings: SimulatorSettings, values: Mapping[str, Any]
) -> dict[str, Any]:
    """Collect everything that a run depends on.

    Parameters
    ----------
    settings : SimulatorSettings
        The section `simulator`.
    values : mapping
        Values of the names that template and command may use.

    Returns
    -------
    dict
        The filled command and input script, the path of the program, the values, the
        hash of each file by its name in the folder of the run, and the names of the
        files that are read or kept. A finished run is used again only if the whole dict
        is the same, so an entry that is added here causes new runs.

    Raises
    ------
    InputError
        If the program or a file is missing, or a name is unknown.
    """
    command = [
        fill_template(part, values, "simulator.command") for part in settings.command
    ]
    program = find_program(command)
    if program is None:
        raise InputError(
            "simulator", key="command", value=command[0], allowed=EXPECTED_PROGRAM
        )
    deck = None
    if settings.template is not None:
        text = read_template(settings.template)
        deck = fill_template(text, values, settings.template)
    # Compare files by their contents, not by their paths or times. `check_simulator`
    # has made sure that their names differ.
    hashes = {}
    for name in settings.files:
        if not Path(name).is_file():
            raise InputError(
                "simulator", key="files", value=name, allowed=EXPECTED_FILE
            )
        hashes[Path(name).name] = provenance.hash_file(name)
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
) -> Outcome | None:
    """Return the outcome of a finished good run with the same inputs.

    Parameters
    ----------
    folder : Path
        Folder of the run, which may not exist.
    inputs : mapping
        Result of `_collect_inputs`.
    settings : SimulatorSettings
        The simulator, which names the files that must exist.

    Returns
    -------
    Outcome or None
        None if the run must be made.
    """
    try:
        stored_hash = json.loads((folder / INPUT_HASH_FILE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    is_same = stored_hash == _hash_inputs(inputs)
    is_whole = not any(make_file_error(folder, name) for name in settings.files_read)
    return Outcome(OK) if is_same and is_whole else None


def make_file_error(folder: Path, name: str) -> InputError | None:
    """Make an error if a file of a good run was lost or changed after the run.

    Parameters
    ----------
    folder : Path
        Folder of the run. The ledger of the folder around it lists the file.
    name : str
        One of `SimulatorSettings.files_read`.

    Returns
    -------
    InputError or None
        The error, which the caller may raise. Its message states what to remove so that
        the run is made again. None if the file is as the run left it.
    """
    path = folder / name
    if not path.is_file():
        return InputError(
            path,
            key="file",
            value="lost",
            allowed=f"the file of this run; remove {folder}.json, and run again",
        )
    if ledger.is_changed(folder.parent, f"{folder.name}/{name}"):
        return InputError(
            path,
            key="content",
            value="something else",
            allowed=(
                "the file as this run left it; remove it, which is damaged or edited, "
                f"and {folder}.json, and run again"
            ),
        )
    return None


def _hash_inputs(inputs: Mapping[str, Any]) -> dict[str, str]:
    """Make the content of `INPUT_HASH_FILE`, the hash of the inputs of a run."""
    return {"inputs": provenance.hash_content(dict(inputs))}


def _run_in_folder(
    settings: SimulatorSettings,
    inputs: Mapping[str, Any],
    folder: Path,
) -> Outcome:
    """Run the program in a temporary folder, and rename this folder at the end.

    A folder with the final name is therefore always complete. If there is one already,
    it is replaced.

    Parameters
    ----------
    settings : SimulatorSettings
        The section `simulator`.
    inputs : mapping
        Result of `_collect_inputs`.
    folder : Path
        The folder with its final name.

    Returns
    -------
    Outcome
        How the run ended.
    """
    work_folder = folder.with_name(f"{folder.name}.part")
    # An interrupted run may have left a folder with the temporary name.
    shutil.rmtree(work_folder, ignore_errors=True)
    work_folder.mkdir(parents=True)
    _write_inputs(settings, inputs, work_folder)
    # The first part of the command is the program, which is called by its path.
    command = [inputs["program"], *inputs["command"][1:]]
    outcome = _call_program(command, work_folder, settings)
    # The program may have removed its own folder. Make it again, but empty.
    work_folder.mkdir(exist_ok=True)
    if outcome.status == OK:
        outcome = _check_outputs(settings, work_folder)

    _remove_unlisted_files(work_folder, settings)
    if outcome.status == OK:
        # With the hash of its inputs, a later call can use this run again. A failed run
        # gets no hash, because the user may repair the cause.
        input_hash = json.dumps(_hash_inputs(inputs))
        (work_folder / INPUT_HASH_FILE).write_text(input_hash, encoding="utf-8")
        # The ledger is a list of files with their hashes. It later shows whether a file
        # that is read has changed since the run. List each file under the name that it
        # gets below, when the folder is renamed.
        for name in settings.files_read:
            final_name = f"{folder.name}/{name}"
            ledger.list_file_below(folder.parent, final_name, source=work_folder / name)
    # A folder can only be renamed if there is none with the new name.
    shutil.rmtree(folder, ignore_errors=True)
    os.replace(work_folder, folder)
    return outcome


def _write_inputs(
    settings: SimulatorSettings, inputs: Mapping[str, Any], work_folder: Path
) -> None:
    """Copy the files of a run to its folder, and write its input script and parameters.

    Parameters
    ----------
    settings : SimulatorSettings
        The section `simulator`.
    inputs : mapping
        Result of `_collect_inputs`.
    work_folder : Path
        An empty folder.
    """
    for name in settings.files:
        shutil.copy(name, work_folder / Path(name).name)
    if settings.template is not None:
        deck = work_folder / deck_name(settings.template)
        deck.write_text(inputs["deck"], encoding="utf-8")
    # The file has the variables of the run, such as its seed, at its top level, and the
    # parameters under a key of their own.
    values = inputs["values"]
    run_variables = {name: values[name] for name in RUN_VARIABLES}
    parameters = {
        name: value for name, value in values.items() if name not in RUN_VARIABLES
    }
    text = json.dumps({**run_variables, "parameters": parameters}, indent=1)
    (work_folder / PARAMETERS_FILE).write_text(f"{text}\n", encoding="utf-8")


def _check_outputs(settings: SimulatorSettings, work_folder: Path) -> Outcome:
    """Check whether a program that ended normally has written every file that is read.

    Returns
    -------
    Outcome
        ``ok``, or ``no_output`` with the first file that is missing.
    """
    for name in settings.files_read:
        path = work_folder / name
        if not path.exists():
            return Outcome("no_output", f"{name} is missing")
        if not path.is_file():
            return Outcome("no_output", f"{name} is not a file")
    return Outcome(OK)


def _call_program(
    command: Sequence[str], work_folder: Path, settings: SimulatorSettings
) -> Outcome:
    """Call the program in a folder, without a shell, and wait for its end.

    The file `PRINTED_FILE` receives what the program prints. If the program takes too
    long, or if this process receives a signal to end, the program is stopped with its
    children.

    Parameters
    ----------
    command : sequence of str
        Path of the program, and its arguments.
    work_folder : Path
        The folder.
    settings : SimulatorSettings
        Time limit and number of cores.

    Returns
    -------
    Outcome
        How the program ended.
    """
    # Libraries with threads of their own read OMP_NUM_THREADS.
    environment_changes = {
        "PATH": make_search_path(),
        "OMP_NUM_THREADS": str(settings.cores),
    }
    with open(work_folder / PRINTED_FILE, "wb") as printed, _exit_on_sigterm():
        process = subprocess.Popen(
            command,
            cwd=work_folder,
            stdin=subprocess.DEVNULL,
            stdout=printed,
            stderr=subprocess.STDOUT,
            env={**os.environ, **environment_changes},
            # The program leads a new process group. A signal to the group also reaches
            # the children of the program.
            start_new_session=True,
        )
        try:
            process.wait(settings.time_limit_s)
        except subprocess.TimeoutExpired:
            _stop_program(process)
            return Outcome("time_limit", f"longer than {settings.time_limit_s:g} s")
        # SystemExit, which `_exit_on_sigterm` raises, and KeyboardInterrupt are no
        # subclasses of Exception.
        except BaseException:
            _stop_program(process)
            raise
    if process.returncode == 0:
        return Outcome(OK)
    reason = f"exit status {process.returncode}"
    # If a signal ended the program, Python reports minus the number of the signal.
    if process.returncode < 0:
        reason = f"ended by {signal.Signals(-process.returncode).name}"
    last_line = _read_last_line(work_folder / PRINTED_FILE)
    if last_line:
        reason += f": {last_line}"
    return Outcome("exit_status", reason)


@contextmanager
def _exit_on_sigterm() -> Iterator[None]:
    """Make the signal SIGTERM raise SystemExit within this context.

    By default, the signal would end this process at once and leave the called program
    running. The previous handler is restored at the end.
    """

    def raise_exit(number: int, frame: FrameType | None) -> None:
        # This is the exit status with which a shell reports this signal.
        raise SystemExit(128 + number)

    previous_handler = signal.signal(signal.SIGTERM, raise_exit)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, previous_handler)


def _stop_program(process: "subprocess.Popen[bytes]") -> None:
    """Stop a program with all its children.

    The signal SIGTERM asks the processes to end. The signal SIGKILL ends those that
    still run when the program has ended, or after `STOP_TIME_S`.

    Parameters
    ----------
    process : subprocess.Popen
        The program, which leads a process group of its own.
    """
    # Send both signals even if the program ends after the first one, because its
    # children may still run.
    for signal_number in (signal.SIGTERM, signal.SIGKILL):
        try:
            os.killpg(process.pid, signal_number)
        except ProcessLookupError:
            # All processes of the group have ended.
            return
        with suppress(subprocess.TimeoutExpired):
            process.wait(STOP_TIME_S)


def _read_last_line(path: Path) -> str:
    """Read the end of the last line that a program printed.

    It has at most `MAX_REASON_LENGTH` characters. It is empty if there is no file.
    """
    if not path.is_file():
        return ""
    text = path.read_text(encoding="utf-8", errors="replace").rstrip()
    line = text.rpartition("\n")[2].strip()
    return "".join(filter(str.isprintable, line))[-MAX_REASON_LENGTH:]


def _remove_unlisted_files(work_folder: Path, settings: SimulatorSettings) -> None:
    """Remove the files of a run that are neither read nor kept, and empty folders.

    Parameters
    ----------
    work_folder : Path
        Folder of the run.
    settings : SimulatorSettings
        The simulator, which lists the files that are read or kept.
    """
    kept_names = {PARAMETERS_FILE, PRINTED_FILE, *settings.files_read, *settings.keep}
    if settings.template is not None:
        kept_names.add(deck_name(settings.template))
    # In reverse order, the content of a folder comes before the folder itself, which
    # may then be empty.
    for path in sorted(work_folder.rglob("*"), reverse=True):
        if path.is_dir() and not path.is_symlink():
            if not any(path.iterdir()):
                path.rmdir()
        elif str(path.relative_to(work_folder)) not in kept_names:
            path.unlink()
