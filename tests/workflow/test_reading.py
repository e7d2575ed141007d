"""What Snakemake takes to read the workflow, before it plans anything."""

import yaml
from forked import copied
from shared import run_python

from repose.config import earlier_check
from repose.config.workflow_run import prepare_run

QUICK = "config/quick.yaml"
# Snakemake itself imports numpy, PyYAML, Jinja2 and Pillow.
LIBRARIES = ("pandas", "scipy", "matplotlib", "sklearn", "emcee")
LIBRARIES += ("numba", "llvmlite", "cv2", "trimesh")
# An entry None makes the import of a library an error. The workflow that has nothing in
# it loads what every workflow needs. Each reading is a fork that has loaded no more than
# that. Noise only lengthens a time, and the first reading may have to compile modules,
# so the least time counts.
READ = f"""
import sys
sys.modules |= dict.fromkeys({LIBRARIES})
import os
import time
import snakemake.cli

def list_rules(*words):
    try:
        snakemake.cli.main(["--list-rules", *words])
    except SystemExit as end:
        assert not end.code, words
    sys.stdout.flush()

list_rules("--snakefile", "empty.smk")
print(time.process_time(), flush=True)
for _ in range(2):
    child = os.fork()
    if not child:
        list_rules("--configfile", "{QUICK}")
        os._exit(0)
    _, status, used = os.wait4(child, 0)
    assert not status
    print(used.ru_utime + used.ru_stime, flush=True)
"""


def test_a_checked_workflow_is_read_without_libraries_in_less_than_snakemakes_start(
    tmp_path, monkeypatch
):
    project = copied(tmp_path)
    (project / "empty.smk").write_text("rule all:\n    output: 'nothing'\n")
    monkeypatch.chdir(project)
    config = yaml.safe_load((project / QUICK).read_text())
    run = prepare_run(config, [QUICK], has_command_line=False, check_inputs=True)
    earlier_check.write_checked_config(run.new_fingerprint, run.study.config)

    lines = run_python("-c", READ, cwd=project).splitlines()
    rules = {line for line in lines if line.isidentifier()}
    assert {"pour", "miga", "draw_figure13", "sequential", "page"} <= rules
    start_s, *reading_s = (float(line) for line in lines if line[:1].isdigit())
    assert len(reading_s) == 2
    assert min(reading_s) < start_s
