"""What the calibration loads, and that mypy knows the type of each section."""

import pytest
from shared import ROOT, run_python

# Libraries of other rooms, and of extras. The calibration needs numpy, scipy, pandas,
# scikit-learn, emcee and pydantic, and PyYAML for the configuration of a study.
OTHERS = ("numba", "llvmlite", "cv2", "PIL", "trimesh", "matplotlib", "snakemake")
OTHERS += ("psutil", "rich")
LOAD_ALL = f"""
import importlib, pkgutil, sys
sys.modules |= dict.fromkeys({OTHERS})
import repose.calibrate
for module in pkgutil.walk_packages(repose.calibrate.__path__, "repose.calibrate."):
    importlib.import_module(module.name)
print(*sorted(sys.modules))
"""


def test_the_calibration_loads_no_simulator():
    modules = run_python("-c", LOAD_ALL).split()
    rooms = {name.split(".")[1] for name in modules if name.startswith("repose.")}
    assert not rooms & {"grain", "stages", "export", "config", "report", "cli"}


@pytest.mark.slow
@pytest.mark.essential
def test_a_mistyped_section_is_an_error_of_mypy(tmp_path):
    api = pytest.importorskip("mypy.api")
    snippet = tmp_path / "snippet.py"
    snippet.write_text(
        "from repose import PipelineConfig, Study\n"
        "from repose.report.page.study import Results\n"
        "from repose.report.study_view import StudyView\n"
        "from repose.stages.card_study import CardStudy\n"
        "def of_study(study: Study) -> int:\n"
        "    return study.settings.miga.rounds + study.settings.migaa.rounds\n"
        "def of_config(config: PipelineConfig) -> int:\n"
        "    return config.settings.miga.rounds + config.settings.migaa.rounds\n"
        "def of_key(config: PipelineConfig) -> int:\n"
        "    return config.settings.miga.nonsense\n"
        "def of_figure(study: StudyView) -> int:\n"
        "    return study.settings.miga.rounds + study.settings.migaa.rounds\n"
        "def of_page(results: Results) -> int:\n"
        "    return results.measure.viewss if results.measure else 0\n"
        "def of_card(study: CardStudy) -> int:\n"
        "    return study.settings.measure.views + study.settings.meassure.views\n"
    )
    arguments = ["--config-file", str(ROOT / "pyproject.toml"), str(snippet)]
    printed, _, _ = api.run(arguments)
    errors = [line for line in printed.splitlines() if "snippet.py" in line]
    assert [line.split(":")[1] for line in errors] == ["6", "8", "10", "12", "14", "16"]
    assert all("has no attribute" in line for line in errors)
