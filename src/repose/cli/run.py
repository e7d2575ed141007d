"""The verb that runs the whole study: snakemake with the program's own workflow, in any folder."""

from pathlib import Path

from repose.cli.registry import Family
from repose.core import places
from repose.core.errors import InputError

CONFIG_OPTIONS = ("--configfile", "--configfiles")
CORES_OPTIONS = ("-c", "--cores", "-j", "--jobs", "--profile", "--workflow-profile")
SNAKEFILE_OPTIONS = ("-s", "--snakefile")
CONFIG_SUFFIXES = (".yaml", ".yml", ".json")

family = Family()


@family.verb(
    "run the whole study here, or the named targets; every further option goes to snakemake (snakemake --help)",
    example="uncertainty --cores 2 --configfile mine.yaml",
    config=False,
    passes_on=True,
)
def run(args):
    try:
        from snakemake.cli import main
    except ImportError:
        needed = "snakemake, which comes with: pip install 'repose-dem[workflow]'"
        raise InputError("installation", "snakemake", None, needed) from None
    main(snakemake_words(args.rest))


def snakemake_words(words: list[str]) -> list[str]:
    """The command line of snakemake for what `repose run` was given.

    Parameters
    ----------
    words : list of str
        Options of snakemake and targets, in any order.

    Returns
    -------
    list of str
        Targets first, since `--configfile` would take those after it for files; then the options. Without
        `--cores` all cores work; without `--snakefile` the workflow is the program's own. A configuration that
        the working folder lacks, such as config/quick.yaml, is the program's.
    """
    targets: list[str] = []
    options: list[str] = []
    reading_configs = False
    for word in words:
        if word.startswith("-"):
            option, equals, path = word.partition("=")
            reading_configs = option in CONFIG_OPTIONS and not equals
            options.append(f"{option}={places.find(path)}" if option in CONFIG_OPTIONS and equals else word)
        elif not reading_configs:
            options.append(word)
        elif Path(word).suffix in CONFIG_SUFFIXES:
            options.append(str(places.find(word)))
        else:
            targets.append(word)
    if not _given(options, CORES_OPTIONS):
        options = ["--cores", "all", *options]
    if not _given(options, SNAKEFILE_OPTIONS):
        options = ["--snakefile", str(places.root() / "Snakefile"), *options]
    return [*targets, *options]


def _given(words, options):
    """Whether one of the options is among the words, alone, with =VALUE or, where it is short, with its value."""
    return any(
        word.partition("=")[0] in options or (word[:2] in options and not word.startswith("--"))
        for word in words
    )
