"""What Snakemake takes to read the workflow, before it plans anything."""

import yaml
from forked import copied
from shared import run_python

from repose.config import earlier_check
from repose.config.workflow_run import run_of_workflow

QUICK = "config/quick.yaml"
# Snakemake itself imports numpy, PyYAML, Jinja2 and Pillow.
LIBRARIES = ("pandas", "scipy", "matplotlib", "sklearn", "emcee")
LIBRARIES += ("numba", "llvmlite", "cv2", "trimesh")
# An entry None makes the import of a library an error. The workflow that has nothing in
# it loads what every workflow needs.
READ = f"""
import sys
sys.modules |= dict.fromkeys({LIBRARIES})
import time
import snakemake.cli

def list_rules(*words):
    try:
        snakemake.cli.main(["--list-rules", *words])
    except SystemExit as end:
        assert not end.code, words

list_rules("--snakefile", "empty.smk")
start_s = time.process_time()
list_rules("--configfile", "{QUICK}")
print(start_s, time.process_time() - start_s)
"""


def test_a_checked_workflow_is_read_without_libraries_in_less_than_snakemakes_start(
    tmp_path, monkeypatch
):
    project = copied(tmp_path)
    (project / "empty.smk").write_text("rule all:\n    output: 'nothing'\n")
    monkeypatch.chdir(project)
    config = yaml.safe_load((project / QUICK).read_text())
    run = run_of_workflow(config, [QUICK], has_command_line=False, inputs=True)
    earlier_check.write(run.first_check, run.study.config)

    *rules, times = run_python("-c", READ, cwd=project).splitlines()
    assert {"pour", "miga", "draw_figure13", "sequential", "page"} <= {*rules}
    start_s, reading_s = map(float, times.split())
    assert reading_s < start_s
