"""Real workflows and real jobs in forks of one process, so that what they import is loaded once.

A job of the workflow calls `python -m repose VERB`. Here `python` is a small program that hands its arguments, folder
and files to a server, which forks: the child is the job, a process of its own that can be killed. It writes what a job
of a plain run writes, for a twentieth of its time.
"""

import atexit
import base64
import faulthandler
import importlib
import json
import os
import pkgutil
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import psutil

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

ROOT = Path(__file__).parents[2]
COMMAND = (
    "--cores",
    "1",
    "--quiet",
    "rules",
    "--configfile",
    "config/quick.yaml",
    "tiny.yaml",
)
TARGETS = ("validate", "measure")
PARTS = ("Snakefile", "config", "profiles", "resources", "workflow")
# In these an equal run has others: how long jobs took and what they printed. Names with a dot are locks and ledgers;
# NAME.PROCESS.part is what a job that was killed had begun to write, and nothing reads it.
APART = ("logs", "benchmarks", "timings")
# A workflow without a job that has used no processor time for so long hangs [s].
STUCK_S = 120.0
SHIM = """#!{python} -IS
import json, os, socket, sys
server = socket.socket(socket.AF_UNIX)
server.connect("{socket}")
message = json.dumps([os.getcwd(), sys.argv[1:]]).encode()
socket.send_fds(server, [message], [0, 1, 2])
status = server.recv(100)
sys.exit(int(status) if status else 137)
"""


def load_all():
    """Import snakemake and every module of the program but those that only draw."""
    importlib.import_module("snakemake.cli")
    for module in pkgutil.walk_packages(
        importlib.import_module("repose").__path__, "repose."
    ):
        if not module.name.startswith(("repose.report", "repose.__main__")):
            importlib.import_module(module.name)


def make_up_pours(put=setattr):
    """Let the funnel give a cone of grains at once and compile no engine; `put` is setattr, perhaps monkeypatch's."""
    from repose.bench import bench
    from repose.stages import warm_up

    put(bench("funnel"), "run", made_up_pour)
    put(warm_up, "warm_up", lambda *_: 0.0)


def made_up_pour(scene, interval_s=None, progress=None):
    """A cone whose angle follows the parameters and the seed."""
    from repose.bench import Run
    from repose.bench.parameters import PARAMETERS

    time.sleep(0.1)
    parameters = scene.parameters
    seed = scene.seed
    rng = np.random.default_rng(seed)
    slope = (
        0.2
        + 0.4 * sum(parameters[name] for name in PARAMETERS) / len(PARAMETERS)
        + 0.01 * rng.normal()
    )
    share = rng.uniform(size=400) ** (1 / 3)
    turn = rng.uniform(0.0, 2.0 * np.pi, 400)
    radius = np.sqrt(rng.uniform(size=400)) * share * 0.1
    top = slope * 0.1
    position = np.stack(
        [radius * np.cos(turn), radius * np.sin(turn), top * (1.0 - share) + 0.005],
        axis=1,
    )
    record = {
        "seed": int(seed),
        "status": "ok",
        "reason": "",
        "discharge_s": 1.0,
        "berries_on_plate": 400,
        "berries_in_pile": 400,
        "berries_off_plate": 0,
        "kinetic_energy_J": 0.0,
    }
    arrays = {
        "position": position.astype(np.float32),
        "quaternion": np.tile(np.float32([1.0, 0.0, 0.0, 0.0]), (400, 1)),
        "in_pile": np.ones(400, bool),
        "scale": np.ones(400, np.float32),
    }
    return Run(record, arrays)


class Jobs:
    """The server of jobs; `folder` gets the program `python` that calls it."""

    def __init__(self, folder):
        self.bin = Path(folder) / "bin"
        self.bin.mkdir(parents=True)
        address = str(Path(folder) / "jobs")
        shim = self.bin / "python"
        shim.write_text(SHIM.format(python=sys.executable, socket=address))
        shim.chmod(0o755)
        listener = socket.socket(socket.AF_UNIX)
        listener.bind(address)
        listener.listen(64)
        self.process = os.fork()
        if self.process == 0:
            _serve(listener)
        listener.close()

    def running(self):
        with suppress(OSError):
            return list(
                map(
                    int,
                    Path(f"/proc/{self.process}/task/{self.process}/children")
                    .read_text()
                    .split(),
                )
            )
        return []

    def close(self):
        os.kill(self.process, signal.SIGKILL)
        os.waitpid(self.process, 0)


def _serve(listener):
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    # Python ignores an interrupt within the fork: it waits until the job has begun.
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    while True:
        caller, _ = listener.accept()
        if os.fork() == 0:
            listener.close()
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            status = 1
            try:
                signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
                status = _job(caller)
            except SystemExit as end:
                status = end.code if isinstance(end.code, int) else 1
            finally:
                with suppress(OSError):
                    caller.send(str(status).encode())
                os._exit(status)
        caller.close()


def _job(caller):
    message, files, _, _ = socket.recv_fds(caller, 1 << 20, 3)
    folder, arguments = json.loads(message)
    _become(folder, *files)
    assert arguments[:2] == ["-m", "repose"], arguments
    from repose.cli import main

    status = main(arguments[2:])
    sys.stdout.flush()
    return status


def start(folder, arguments, out, err, python=sys.executable):
    """Start `snakemake WORDS` in a folder, printing to two open files; its process number. `python` runs its jobs."""
    child = os.fork()
    if child:
        return child
    status = 1
    try:
        atexit._clear()  # what this process does at its end
        _become(folder, 0, out, err)
        faulthandler.register(signal.SIGUSR1, file=2)
        os.environ["PYTHONPATH"] = os.pathsep.join(
            filter(None, [str(ROOT / "src"), os.environ.get("PYTHONPATH")])
        )
        sys.executable = str(python)
        sys.argv = ["snakemake", "--nocolor", *arguments]
        importlib.import_module("snakemake.cli").main(sys.argv[1:])
        status = 0
    except SystemExit as end:
        if isinstance(end.code, str):
            print(end.code, file=sys.stderr)
        status = end.code if isinstance(end.code, int) else int(end.code is not None)
    finally:
        with suppress(Exception):
            atexit._run_exitfuncs()
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(status)


def ended(process):
    """Wait for the end of a workflow; its exit status.

    One that hangs prints the stacks of its threads, is killed, and raises TimeoutError.
    """
    workflow = psutil.Process(process)
    earlier_s = None
    while not os.waitid(os.P_PID, process, os.WEXITED | os.WNOHANG | os.WNOWAIT):
        used_s = sum(workflow.cpu_times())
        if used_s != earlier_s or workflow.children():
            earlier_s = used_s
            idle_since = time.monotonic()
        elif time.monotonic() - idle_since > STUCK_S:
            os.kill(process, signal.SIGUSR1)
            time.sleep(1.0)
            os.kill(process, signal.SIGKILL)
            os.waitpid(process, 0)
            raise TimeoutError(f"hung for {STUCK_S:.0f} s")
        time.sleep(0.1)
    return os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])


def _become(folder, *files):
    """Take a folder and three open files for this process."""
    for number, file in enumerate(files):
        os.dup2(file, number)
    sys.stdout, sys.stderr = open(1, "w", closefd=False), open(2, "w", closefd=False)  # noqa: SIM115
    os.chdir(folder)


def copied(folder):
    """What a study needs of the checkout, copied to a folder."""
    for part in PARTS:
        source = ROOT / part
        place = folder / part
        place.parent.mkdir(parents=True, exist_ok=True)
        shutil.copytree(source, place) if source.is_dir() else shutil.copy(
            source, place
        )
    return folder


class Study:
    """The tiny study in a folder, and its workflow."""

    def __init__(self, folder, jobs, targets=TARGETS):
        self.folder = Path(folder)
        self.jobs = jobs
        self.log = Path(f"{folder}.log")
        self.targets = targets
        self.more = ()

    def prepared(self):
        shutil.copy(Path(__file__).with_name("tiny.yaml"), copied(self.folder))
        return self

    def copied_to(self, folder):
        subprocess.run(["cp", "-a", f"{self.folder}/.", folder], check=True)
        return Study(folder, self.jobs, self.targets)

    def start(self, *forced):
        arguments = ("--forcerun", *forced) if forced else ()
        arguments = (*arguments, *COMMAND, *self.more, "--", *self.targets)
        with self.log.open("wb") as log:
            return start(
                self.folder,
                arguments,
                log.fileno(),
                log.fileno(),
                self.jobs.bin / "python",
            )

    def run(self, *forced):
        """Run the workflow to its end; its exit status."""
        return ended(self.start(*forced))

    def results(self):
        top = self.folder / "results"
        return {
            str(path.relative_to(top)): path.read_bytes()
            for path in sorted(top.rglob("*"))
            if path.is_file()
            and path.suffix != ".part"
            and not {*APART} & {*path.parts}
            if not path.name.startswith(".")
        }

    def finished(self):
        """Files of jobs that snakemake recorded as finished, single kept runs, and the times of new pours."""
        records = self.folder / ".snakemake"
        done = {path.name for path in (records / "metadata").glob("*")}
        begun = {path.name for path in (records / "incomplete").glob("*")}
        paths = {
            self.folder / base64.urlsafe_b64decode(name).decode()
            for name in done - begun
        }
        paths |= {
            path
            for kept in ("runs/*_*.npz", "timings/*.json")
            for path in (self.folder / "results").rglob(kept)
        }
        return {
            path: (path.stat().st_ino, path.stat().st_mtime_ns)
            for path in paths
            if path.exists()
        }

    def made_again(self, before):
        """Of files that `finished` once gave, those that are not as they were; a whole job replaces its runs."""
        now = self.finished()

        def was_poured_again(path):
            name, _, seed = path.stem.rpartition("_")
            times = path.parents[1] / "timings" / f"{name}.json"
            return (
                now.get(times) != before.get(times)
                and seed in json.loads(times.read_text())["wall_s"]
            )

        changed = [path for path, when in before.items() if now.get(path) != when]
        return [
            path
            for path in changed
            if path in now or path.parent.name != "runs" or was_poured_again(path)
        ]

    def last_words(self):
        """The last line that the workflow printed."""
        lines = [
            line
            for line in self.log.read_text(errors="replace").splitlines()
            if line.strip()
        ]
        return lines[-1] if lines else ""

    def remove_what_it_named(self):
        named = re.findall(
            r"^repose: error: (\S+): ",
            self.log.read_text(errors="replace"),
            re.MULTILINE,
        )
        found = [
            self.folder / name for name in set(named) if (self.folder / name).is_file()
        ]
        for path in found:
            path.unlink()
        return len(found)

    def configured(self, **sections):
        """Lay sections over the configuration of the next runs."""
        (self.folder / "change.yaml").write_text(json.dumps(sections))
        self.more = ("change.yaml",)
        return self

    def pours(self):
        top = self.folder / "results"
        return {
            path.relative_to(top): path.stat().st_mtime_ns
            for path in top.rglob("runs/*.npz")
        }


def compared(study, expected):
    found = study.results()
    for name in sorted(set(found) | set(expected)):
        if name not in found:
            print(f"    {name}: lost", flush=True)
        elif name not in expected:
            print(f"    {name}: new", flush=True)
        elif found[name] != expected[name]:
            print(f"    {name}: other bytes", flush=True)
    return found == expected
