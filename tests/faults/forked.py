"""Real workflows and real jobs in forks of one process, so that what they import is loaded once.

A job of the workflow calls `python -m repose VERB`. Here `python` is a small program that hands its arguments, folder
and files to a server, which forks: the child is the job, a process of its own that can be killed. It writes what a job
of a plain run writes, for a twentieth of its time.
"""

import importlib
import json
import os
import pkgutil
import signal
import socket
import sys
import time
from contextlib import suppress
from pathlib import Path

import numpy as np

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

ROOT = Path(__file__).parents[2]
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
    package = importlib.import_module("repose")
    for module in pkgutil.walk_packages(package.__path__, "repose."):
        if not module.name.startswith(("repose.pictures", "repose.verification", "repose.__main__")):
            importlib.import_module(module.name)


def make_up_pours():
    """Let the funnel give a cone of grains at once, and compile no engine: the files are of the same kinds."""
    from repose.apparatus import bench_test, warm_up

    bench_test.bench("funnel").run = made_up_pour
    warm_up.warm_up = lambda *_: 0.0


def made_up_pour(scene, interval_s=None, progress=None):
    """A cone whose angle follows the parameters and the seed."""
    from repose.apparatus import Run
    from repose.core.parameters import PARAMETERS

    time.sleep(0.1)
    parameters, seed = scene.parameters, scene.seed
    rng = np.random.default_rng(seed)
    slope = 0.2 + 0.4 * sum(parameters[name] for name in PARAMETERS) / len(PARAMETERS) + 0.01 * rng.normal()
    share, turn = rng.uniform(size=400) ** (1 / 3), rng.uniform(0.0, 2.0 * np.pi, 400)
    radius = np.sqrt(rng.uniform(size=400)) * share * 0.1
    top = slope * 0.1
    position = np.stack([radius * np.cos(turn), radius * np.sin(turn), top * (1.0 - share) + 0.005], axis=1)
    record = {"seed": int(seed), "status": "ok", "reason": "", "discharge_s": 1.0, "berries_on_plate": 400}
    record |= {"berries_in_pile": 400, "berries_off_plate": 0, "kinetic_energy_J": 0.0}
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
        try:
            found = Path(f"/proc/{self.process}/task/{self.process}/children").read_text().split()
        except OSError:
            return []
        return [int(one) for one in found]

    def close(self):
        os.kill(self.process, signal.SIGKILL)
        os.waitpid(self.process, 0)


def _serve(listener):
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    while True:
        caller, _ = listener.accept()
        if os.fork() == 0:
            listener.close()
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            status = 1
            try:
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
    folder, words = json.loads(message)
    _become(folder, *files)
    assert words[:2] == ["-m", "repose"], words
    from repose.cli import main

    status = main(words[2:])
    sys.stdout.flush()
    return status


def start_workflow(folder, jobs, words, log):
    """Start `snakemake WORDS` in a folder; its process number, at once.

    Parameters
    ----------
    folder : Path
    jobs : Jobs
    words : sequence of str
    log : Path
        Gets what it prints.
    """
    child = os.fork()
    if child:
        return child
    status = 1
    try:
        out = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        _become(folder, 0, out, out)
        sys.executable = str(jobs.bin / "python")  # the jobs' Python lies beside the workflow's
        sys.argv = ["snakemake", "--nocolor", *words]
        importlib.import_module("snakemake.cli").main(sys.argv[1:])
        status = 0
    except SystemExit as end:
        if isinstance(end.code, str):
            print(end.code, file=sys.stderr)
        status = end.code if isinstance(end.code, int) else int(end.code is not None)
    finally:
        with suppress(Exception):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(status)


def _become(folder, *files):
    """Take a folder and three open files for this process."""
    for number, file in enumerate(files):
        os.dup2(file, number)
    sys.stdout, sys.stderr = open(1, "w", closefd=False), open(2, "w", closefd=False)  # noqa: SIM115
    os.chdir(folder)
