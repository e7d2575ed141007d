"""Files that come with the program, and those of the working folder before them."""

from pathlib import Path

import pytest
from refusals import input_error
from shared import written

from repose.common import places
from repose.config import loader
from repose.config.pipeline import PipelineConfig

METHOD = places.find_program_folder() / "config" / "method.yaml"
CONFIG = places.find_program_folder() / "config" / "config.yaml"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def faulty(source, *files, **options):
    """The keys with a fault in a study, all of this file."""
    faults = input_error("expected", PipelineConfig.load, *files, **options).faults
    assert {fault.source for fault in faults} == {source}
    return {fault.key for fault in faults}


def test_a_file_is_the_folders_own_or_the_programs_or_keeps_its_name(folder):
    path = Path("resources/berries.csv")
    for name in (
        path,
        "Snakefile",
        "workflow/Snakefile",
        "profiles/default/config.yaml",
        "config",
    ):
        assert places.find_file(name) == places.find_program_folder() / name
        assert (places.find_program_folder() / name).exists()
    path.parent.mkdir()
    path.touch()
    assert places.find_file("resources/berries.csv") == path
    assert places.find_file("mine.csv") == Path("mine.csv")


def test_a_study_of_a_crop_lies_over_the_programs_which_it_replaces(folder):
    assert places.list_default_configs() == [METHOD, CONFIG]
    config = PipelineConfig.load(check_inputs=True).config
    for path in (
        config["berry"]["sizes"],
        config["berry"]["compression"],
        config["validation"]["published"],
    ):
        assert Path(path).is_absolute()
        assert Path(path).is_file()
    config_file = folder / "config/config.yaml"
    config_file.parent.mkdir()
    config_file.write_text("label: mine\n")
    assert places.list_default_configs() == [METHOD, CONFIG, Path("config/config.yaml")]
    assert PipelineConfig.load(check_inputs=True).config["label"] == "mine"
    # another crop: no layer of the program's lies under it
    config_file.write_text("berry: {sizes: sizes.csv}\n")
    assert loader.list_files_with_defaults([]) == [METHOD, Path("config/config.yaml")]
    config_file.unlink()
    (folder / "config.yaml").write_text("label: mine\n")
    assert places.list_default_configs() == [METHOD, Path("config.yaml")]
    assert {"berry.sizes", "parameters", "targets", "funnel.berries"} <= faulty(
        "config.yaml", check_inputs=True
    )


def test_a_given_file_lies_over_what_every_crop_or_the_folders_crop_shares(folder):
    mine = written(
        folder / "wheat.yaml",
        "label: wheat\nberry: {sizes: sizes.csv, density_kg_m3: 1250}\n",
    )
    assert loader.list_files_with_defaults([mine]) == [METHOD, mine]
    missing = {
        "parameters",
        "targets",
        "funnel.berries",
        "wall",
        "funnel.plate_diameter_mm",
    }
    assert missing <= faulty(str(mine), mine)
    mine = written(
        folder / "mine.yaml",
        "berry: {particle: ellipsoid, mass_g: null}\nfunnel: {seeds: 3}\n",
    )
    assert loader.list_files_with_defaults([mine]) == [METHOD, CONFIG, mine]
    mine.write_text("berry: {density_kg_m3: 900}\n")
    # the program's crop, asked for by name
    expected = [
        METHOD,
        CONFIG,
        mine,
    ]
    assert loader.list_files_with_defaults([CONFIG, mine]) == expected
    (folder / "config.yaml").write_text("berry: {sizes: sizes.csv}\n")
    assert loader.list_files_with_defaults([mine]) == [
        METHOD,
        Path("config.yaml"),
        mine,
    ]


def test_in_the_programs_own_folder_there_is_one_configuration():
    assert places.list_default_configs() == [
        Path("config/method.yaml"),
        Path("config/config.yaml"),
    ]
    assert (
        PipelineConfig.load("config/config.yaml").config["berry"]["sizes"]
        == "resources/berries.csv"
    )
