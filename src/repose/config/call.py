"""One call of snakemake: what its command line asks for, the folder that it takes, the time that it tells.

The command line is snakemake's interface; none of its insides is used here.
"""

import argparse
import atexit
import math
import os
import re
import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from repose.common import usage
from repose.common.errors import BAD_INPUT, print_fault
from repose.common.lock import take_folder
from repose.config import loader, results_folder, stands_on
from repose.config.study import Study

# Words of calls that look at the workflow and run no job. A call that is not known here runs, at worst, into the lock.
LOOKS = re.compile(
    r"-[npFkqr]*n[npFkqr]*$|-[hvlSDd]$|--(dry-?r|help|version|summary|detailed-s|list|lint|dag|d3dag|rulegraph"
    r"|filegraph|report|unlock|archive|cleanup|delete|containerize|generate|print-c|bash-c|draft)"
)
BORN = Path(
    ".snakemake/of_repose"
)  # made with snakemake's records: no result that is older is in them


def configfiles(words: Sequence[str]) -> list[str]:
    """Return the files of configurations on a command line of snakemake."""
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    parser.add_argument(
        "--configfile", "--configfiles", nargs="+", action="extend", default=[]
    )
    paths = parser.parse_known_args(list(words))[0].configfile
    return [
        path for path in paths if Path(path).suffix in (".yaml", ".yml", ".json")
    ]  # the others are targets


class Call:
    """The call of snakemake in this process."""

    def __init__(self) -> None:
        self.words = sys.argv[1:]
        # a job of a cluster starts a snakemake of its own, after the first one has checked everything
        self.is_first = "--mode" not in self.words
        self.runs = self.is_first and not any(map(LOOKS.match, self.words))
        self.began_s = self._began_s()

    def _began_s(self) -> float:
        """When this program began; a clock that was set since the system started moves psutil's answer by seconds."""
        import psutil

        if usage.EARLIER_S:  # a shell began this process
            return time.time() - time.process_time()
        boot_s = time.time() - time.clock_gettime(
            getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC)
        )
        return boot_s + psutil.Process().create_time() - psutil.boot_time()

    def study(self, config: Mapping[str, Any]) -> Study:
        """Make the study of snakemake's `config`, with its files checked where jobs may follow."""
        given = any(re.match(r"(--config|-C)(=|$)", word) for word in self.words)
        files = [_as_typed(path) for path in configfiles(self.words)]
        read = loader.over_defaults(
            config, files, loader.COMMAND_LINE if given else loader.WORKFLOW
        )
        return Study.of(*read, inputs=self.is_first and "--rulegraph" not in self.words)

    def take(self, study: Study, outputs: Iterable[str], chain: Iterable[str]) -> None:
        """Refuse what is no result of the study; a call that runs takes the folder and writes the configuration.

        `outputs` are the paths that rules write, with their wildcards in braces. Where a file of the `chain` or of a
        batch is older than snakemake's records, its own record tells whether it is of this study.
        """
        if not self.is_first:
            return
        folder, outputs = study.settings.results_dir, list(outputs)
        results_folder.check_no_foreign_files(folder, outputs)
        born_s = BORN.stat().st_mtime if BORN.exists() else math.inf
        batches = filter(
            results_folder.pattern_of(outputs).fullmatch,
            map(str, Path(folder).glob("*/batch_*/**/*.json")),
        )
        paths = [path for path in (*chain, *batches) if os.path.exists(path)]
        outdated = stands_on.outdated(
            study.config, (path for path in paths if os.stat(path).st_mtime < born_s)
        )
        if outdated and not {"--forceall", "-F"} & set(self.words):
            others = "with other settings or by another engine, and the records of snakemake are lost: add --forceall"
            print_fault(
                f"{outdated[0]} and {len(outdated) - 1} more results were made {others}"
            )
            sys.exit(BAD_INPUT)
        if self.runs:
            self.lock = take_folder(folder)  # as long as the process lives
            loader.write_resolved(study.config, Path(folder) / loader.RESOLVED)
            BORN.parent.mkdir(exist_ok=True)
            if not BORN.exists():
                BORN.touch()
            atexit.register(self._tell, folder)

    def made(self, path: str, folder: str) -> bool:
        """Return whether a job of this call made a file."""
        ran = usage.since(folder, self.began_s)  # or else files are only touched
        return (
            bool(ran)
            and os.path.exists(path)
            and os.stat(path).st_mtime >= self.began_s
        )

    def _tell(self, folder: str) -> None:
        """Print the times of this call, if a job ran, and add them to the table of all calls."""
        import pandas as pd

        from repose.common.files import read_table, write_table
        from repose.common.provenance import machine

        used = usage.since(folder, self.began_s)
        if not used:
            return
        usage.correct_benchmarks(folder, used)
        me, host = str(os.getpid()), os.uname().nodename
        elsewhere = (
            one for one in used if one.host != host or me not in one.ancestors.split()
        )
        path = f"{folder}/benchmarks/calls.csv"
        call = {
            "began": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(self.began_s)),
            "wall_s": round(time.time() - self.began_s, 1),
            "cpu_s": round(
                usage.used_here_s() + sum(one.cpu_s for one in elsewhere), 1
            ),
            "processor": machine()["processor"],
        }
        earlier = [read_table(path, call)] if os.path.exists(path) else []
        calls = pd.concat([*earlier, pd.DataFrame([call])])
        last, whole = (
            f"{table.wall_s.sum() / 60:.1f} min by the clock, {table.cpu_s.sum() / 60:.1f} min of processor time"
            for table in (calls[-1:], calls)
        )
        more = f"; all {len(calls)} calls: {whole}" if earlier else ""
        with suppress(OSError):  # the terminal is closed
            print(
                f"time: {last} on {call['processor']}{more} ({path})", file=sys.stderr
            )
        write_table(path, calls)


def _as_typed(path: str) -> str:
    """Write a path as one would type it: relative if it is below the working directory."""
    here, absolute = os.getcwd(), os.path.abspath(path)
    return (
        os.path.relpath(absolute, here)
        if os.path.commonpath([absolute, here]) == here
        else absolute
    )
