"""Runs of a program of the user's own: what it gets, how it may fail, and what is read of it."""

import errno
import json
import multiprocessing
import os
import signal
import textwrap
import time

import pytest
from refusals import input_error
from test_particles import RADIUS, SETTINGS, cone, dump_text

from repose.calibrate.seeds import draw_run_seeds
from repose.common import ledger
from repose.common.errors import InputError
from repose.common.files import write_json
from repose.config import results_folder
from repose.measure import particle_files
from repose.measure.particles import measure_particles
from repose.stages import simulate, simulated
from repose.stages.settings import SimulatorSettings

PARAMETERS = {"friction": 0.5, "rolling": 0.1}
GOOD = """
import json
given = json.load(open("parameters.json"))
angle = 20 + 10 * given["parameters"]["friction"] + given["seed"] / 1e9
json.dump({"angle": angle}, open("out.json", "w"))
open("large.bin", "w").write("x" * 100)
"""


def settings(tmp_path, code, **keys):
    (tmp_path / "program.py").write_text(textwrap.dedent(code))
    keys = {
        "name": "toy",
        "command": ["python", "program.py"],
        "files": [str(tmp_path / "program.py")],
        "output": "out.json",
    } | keys
    stated = {key: value for key, value in keys.items() if value is not None}
    return SimulatorSettings.model_validate(stated)


def run(tmp_path, section, **keys):
    keys = {"sample": 1, "run": 1, "seed": 5, "out_dir": tmp_path / "001"} | keys
    return simulate.run_once(section, PARAMETERS, **keys)


def measured(tmp_path, section, responses=("angle",)):
    return simulated.measure_sample(
        [tmp_path / "001" / "1.json"],
        tmp_path / "001.json",
        settings=section,
        responses=responses,
        measure=None,
    )["runs"][0]


def test_a_run_gets_its_parameters_and_leaves_its_responses(tmp_path):
    section = settings(tmp_path, GOOD)
    record = run(tmp_path, section)
    assert record["status"] == "ok"
    assert record["reason"] == ""
    expected = {
        "seed": 5,
        "status": "ok",
        "reason": "",
        "angle": 25 + 5e-9,
    }
    assert measured(tmp_path, section) == expected
    names = sorted(os.listdir(tmp_path / "001" / "1"))
    assert names == [".run.json", "out.json", "parameters.json", "printed.txt"]


def test_files_to_keep_stay(tmp_path):
    run(tmp_path, settings(tmp_path, GOOD, keep=["large.bin"]))
    assert (tmp_path / "001" / "1" / "large.bin").is_file()


@pytest.mark.parametrize(
    ("code", "status", "reason"),
    [
        ("raise SystemExit('no contact model')", "exit_status", "no contact model"),
        ("import os; os.kill(os.getpid(), 9)", "exit_status", "SIGKILL"),
        ("import time; time.sleep(60)", "time_limit", "longer than 0.5 s"),
        ("pass", "no_output", "out.json is missing"),
    ],
)
def test_a_run_that_fails_has_a_status_and_a_reason(tmp_path, code, status, reason):
    limit_s = 0.5 if status == "time_limit" else 30.0
    section = settings(tmp_path, code, time_limit_s=limit_s)
    record = run(tmp_path, section)
    assert record["status"] == status
    assert reason in record["reason"]
    assert measured(tmp_path, section)["angle"] is None


@pytest.mark.parametrize(
    ("written", "status"),
    [
        ('{"angle": NaN}', "bad_output"),
        ('{"angle": Infinity}', "bad_output"),
        ('{"angle": "text"}', "bad_output"),
        ('{"other": 1}', "bad_output"),
        ('{"angle": true}', "bad_output"),
        ('{"angle": 30, "angle": 60}', "bad_output"),
        ("[1, 2]", "bad_output"),
        ("{", "bad_output"),
        ('{"angle": 30, "status": "diverged"}', "failed"),
        ('{"angle": 30, "status": "done"}', "ok"),
        ('{"angle": 30}', "ok"),
    ],
)
def test_an_output_is_judged_as_a_told_run(tmp_path, written, status):
    section = settings(tmp_path, f"open('out.json', 'w').write({written!r})")
    run(tmp_path, section)
    result = measured(tmp_path, section)
    assert result["status"] == status
    assert (result["angle"] == 30) == (status == "ok")
    assert bool(result["reason"]) == (status != "ok")


def test_a_missing_response_is_reported_with_what_the_run_left(tmp_path):
    section = settings(tmp_path, """open('out.json', 'w').write('{"Angle": 30}')""")
    run(tmp_path, section)
    reason = "no finite number for angle; the run left {'Angle': 30}"
    assert measured(tmp_path, section)["reason"] == reason


@pytest.mark.parametrize(
    ("table", "status"),
    [
        ("angle,other\n30,x\n", "ok"),
        ("angle\nnan\n", "bad_output"),
        ("angle\n30\n31\n", "bad_output"),
        ("angle\n", "bad_output"),
    ],
)
def test_a_csv_file_has_one_row(tmp_path, table, status):
    code = f"open('out.csv', 'w').write({table!r})"
    section = settings(tmp_path, code, output="out.csv")
    run(tmp_path, section)
    assert measured(tmp_path, section)["status"] == status


def test_a_good_run_is_kept_and_a_failed_one_is_made_again(tmp_path):
    code = "print(open('parameters.json').read()); open('out.json', 'x').write('{}')"
    section = settings(tmp_path, code)
    run(tmp_path, section)
    written = tmp_path / "001" / "1" / "out.json"
    first = written.stat().st_mtime_ns
    run(tmp_path, section)
    assert written.stat().st_mtime_ns == first
    run(tmp_path, section, seed=6)
    assert written.stat().st_mtime_ns > first

    failing = settings(tmp_path, "raise SystemExit(1)")
    run(tmp_path, failing)
    (tmp_path / "program.py").write_text("open('out.json', 'w').write('{}')")
    assert run(tmp_path, failing)["status"] == "ok"


def edit(first, _):
    first.write_text(first.read_text().replace("2", "3"))


def truncate(first, _):
    first.write_bytes(first.read_bytes()[:-3])


def exchange_files(first, second):
    parked = first.with_name("parked")
    first.rename(parked)
    second.rename(first)
    parked.rename(second)


def exchange_folders(first, second):
    exchange_files(first.parent, second.parent)


@pytest.mark.parametrize(
    ("change", "n_changed"),
    [(edit, 1), (truncate, 1), (exchange_files, 2), (exchange_folders, 2)],
)
def test_a_changed_output_is_named_and_its_run_made_again(tmp_path, change, n_changed):
    section = settings(tmp_path, GOOD)
    results = tmp_path / "results"
    write_json(results / "config.json", {})
    folders = [results / "runs" / f"00{sample}" for sample in (1, 2, 3)]
    outputs = [folder / "1" / "out.json" for folder in folders]

    def make_all():
        for k, folder in enumerate(folders):
            run(tmp_path, section, sample=1 + k, seed=1 + k, out_dir=folder)

    def check_folder():
        rules = [f"{results}/runs/{{sample}}/{{run}}.json"]
        results_folder.check_no_foreign_files(str(results), rules)

    make_all()
    check_folder()
    texts = [path.read_text() for path in outputs]
    times = [path.stat().st_mtime_ns for path in outputs]
    change(*outputs[:2])

    # A run of the workflow names each file, and what to do.
    lines = str(input_error("its run wrote it", check_folder)).splitlines()
    assert len(lines) == n_changed
    for line, output in zip(lines, outputs, strict=False):
        record = output.parent.with_suffix(".json")
        assert line.startswith(f"{output}: content is 'something else'; expected")
        assert (
            f"remove this file, which is damaged or edited, and {record}, and" in line
        )

    # So does the stage that would read it.
    message = r"001/1/out\.json: content .* remove it, .* and .*001/1\.json, and run"
    read = (outputs[0].parent, section, ("angle",), None)
    input_error(message, simulated.read_responses, *read)

    # What the message says makes such a run again, and keeps the others.
    for output in outputs[:n_changed]:
        output.unlink()
        output.parent.with_suffix(".json").unlink()
    check_folder()
    make_all()
    check_folder()
    assert [path.read_text() for path in outputs] == texts
    kept = outputs[n_changed:]
    assert [path.stat().st_mtime_ns for path in kept] == times[n_changed:]


def test_an_edited_output_is_not_kept_and_a_run_without_a_list_is(tmp_path):
    section = settings(tmp_path, GOOD)
    run(tmp_path, section)
    output = tmp_path / "001" / "1" / "out.json"
    text = output.read_text()
    output.write_text("{}")
    run(tmp_path, section)
    assert output.read_text() == text

    # Earlier versions listed no outputs; their runs are not lost.
    (tmp_path / "001" / ledger.LEDGER).write_text("")
    (tmp_path / "001" / "1.json").unlink()
    before = output.stat().st_mtime_ns
    run(tmp_path, section)
    assert output.stat().st_mtime_ns == before


@pytest.mark.parametrize("text", ["", "[]", '{"inputs": 1}', "{}"])
def test_a_run_with_a_damaged_mark_is_made_again(tmp_path, text):
    section = settings(tmp_path, GOOD)
    run(tmp_path, section)
    folder = tmp_path / "001" / "1"
    (folder / ".run.json").write_text(text)
    (folder / "out.json").write_text("{}")
    run(tmp_path, section)
    assert "angle" in json.loads((folder / "out.json").read_text())


def test_values_never_reach_a_shell(tmp_path):
    command = ["python", "program.py", "$HOME; touch x {{ friction }}", "{{ seed }}"]
    code = "import json, sys; json.dump(sys.argv[1:], open('out.json', 'w'))"
    section = settings(tmp_path, code, command=command)
    run(tmp_path, section)
    printed = json.loads((tmp_path / "001" / "1" / "out.json").read_text())
    assert printed == ["$HOME; touch x 0.5", "5"]


def test_a_template_is_filled(tmp_path):
    template = tmp_path / "deck.in.j2"
    template.write_text("mu {{ friction }} {{ rolling }} {{ seed }}\n")
    section = settings(tmp_path, GOOD, template=str(template))
    run(tmp_path, section)
    deck = tmp_path / "001" / "1" / "deck.in"
    assert deck.read_text() == "mu 0.5 0.1 5\n"


def test_a_fault_of_the_set_up_is_no_failed_run(tmp_path):
    template = tmp_path / "deck.in.j2"
    template.write_text("{{ fricton }}")
    with pytest.raises(InputError, match="fricton"):
        run(tmp_path, settings(tmp_path, GOOD, template=str(template)))
    with pytest.raises(InputError, match="no_such_program"):
        run(tmp_path, settings(tmp_path, GOOD, command=["no_such_program"]))


def test_all_faults_are_found_before_any_run(tmp_path):
    template = tmp_path / "deck.in.j2"
    template.write_text("{{ friction }} {{ fricton }}")
    section = settings(
        tmp_path,
        GOOD,
        command=["no_such_program", "{{ x }}"],
        template=str(template),
        files=[str(tmp_path / "none.stl")],
        output=None,
        particles={"file": "pile.dump"},
    )
    with pytest.raises(InputError) as caught:
        simulate.check_simulator(section, PARAMETERS, ("angle", "aor_deg"), "own.yaml")
    faults = str(caught.value)
    for fault in ("no_such_program", "fricton", "name is 'x'", "none.stl", "rolling"):
        assert fault in faults, fault
    assert "targets.angle" in faults
    assert "targets.aor_deg" not in faults


def test_two_files_of_a_run_must_not_have_one_name(tmp_path):
    (tmp_path / "parameters.json").write_text("{}")
    section = settings(tmp_path, GOOD, files=[str(tmp_path / "parameters.json")])
    with pytest.raises(InputError, match=r"simulator\.files"):
        simulate.check_simulator(section, {}, ("angle",), "own.yaml")


@pytest.mark.parametrize(
    ("output", "template"),
    [
        ("parameters.json", None),
        ("program.py", None),
        ("deck.json", "deck.json.j2"),
    ],
)
def test_a_run_is_not_read_from_a_file_that_it_was_given(tmp_path, output, template):
    keys = {"output": output}
    if template is not None:
        (tmp_path / template).write_text("{{ friction }} {{ rolling }}")
        keys["template"] = str(tmp_path / template)
    section = settings(tmp_path, GOOD, **keys)
    with pytest.raises(InputError, match=r"simulator\.output is .*the run writes"):
        simulate.check_simulator(section, PARAMETERS, ("angle",), "own.yaml")


@pytest.mark.parametrize("name", simulate.RUN_VARIABLES)
def test_a_parameter_has_no_name_of_the_run(tmp_path, name):
    with pytest.raises(InputError, match=rf"parameters\.{name} is"):
        simulate.check_simulator(
            settings(tmp_path, GOOD), {name: 0.5}, ("angle",), "own.yaml"
        )


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (b"{{ friction }}\n{{ 1 / (rolling - rolling) }}", "line 2.*ZeroDivisionError"),
        (b"{{ friction }}\n{{ (rolling | int)[0] }}", "line 2.*UndefinedError"),
        (b"{{ friction }} {{ rolling.x.y }}", "line 1.*has no attribute"),
        (
            b"{% for i in range(10**9) %}{{ friction }}{{ rolling }}{% endfor %}",
            "range",
        ),
        (b"{{ friction }} {{ rolling }} {% include 'a.j2' %}", "a.j2.*one file"),
        (b"{{ friction }} {{ rolling }} \xe9", "text in UTF-8"),
    ],
)
def test_a_template_that_cannot_be_filled_is_found_before_any_run(
    tmp_path, text, fault
):
    template = tmp_path / "deck.in.j2"
    template.write_bytes(text)
    section = settings(tmp_path, GOOD, template=str(template))
    with pytest.raises(InputError, match=f"(?s)deck.in.j2.*{fault}"):
        simulate.check_simulator(section, PARAMETERS, ("angle",), "own.yaml")


def test_a_command_that_cannot_be_filled_is_found_before_any_run(tmp_path):
    command = ["python", "{{ [1, 2][run] // 0 }}"]
    section = settings(tmp_path, GOOD, command=command)
    with pytest.raises(InputError, match=r"simulator\.command.*ZeroDivisionError"):
        simulate.check_simulator(section, PARAMETERS, ("angle",), "own.yaml")


def test_a_program_may_remove_its_folder(tmp_path):
    code = "import os, shutil; shutil.rmtree(os.getcwd())"
    record = run(tmp_path, settings(tmp_path, code))
    assert (record["status"], record["reason"]) == ("no_output", "out.json is missing")
    record = run(tmp_path, settings(tmp_path, f"{code}; raise SystemExit(3)"))
    assert (record["status"], record["reason"]) == ("exit_status", "exit status 3")


def test_a_folder_in_place_of_the_output_is_named(tmp_path):
    record = run(tmp_path, settings(tmp_path, "import os; os.mkdir('out.json')"))
    assert (record["status"], record["reason"]) == (
        "no_output",
        "out.json is not a file",
    )


def test_seeds_differ_and_are_small_enough_for_lammps():
    seeds = {
        simulate.draw_seed(1, purpose, sample, run)
        for purpose in ("design", "validation")
        for sample in (1, 2)
        for run in (1, 2, 3)
    }
    assert len(seeds) == 12
    assert all(1 <= seed <= 899_999_999 for seed in seeds)
    first = draw_run_seeds(1, "design", 2, 3, apparatus="own")[2]
    assert simulate.draw_seed(1, "design", 2, 3) == 1 + first % 899_999_999


def test_a_killed_job_ends_its_program_and_leaves_no_run(tmp_path):
    mark = tmp_path / "pid"
    code = f"""
    import os, time
    open({str(mark)!r}, "w").write(str(os.getpid()))
    time.sleep(60)
    """
    section = settings(tmp_path, code)
    job = multiprocessing.get_context("fork").Process(
        target=run, args=(tmp_path, section)
    )
    job.start()
    deadline = time.monotonic() + 60
    while not (mark.is_file() and mark.read_text()) and time.monotonic() < deadline:
        time.sleep(0.05)
    job.terminate()
    job.join(30)
    assert job.exitcode == 128 + signal.SIGTERM
    with pytest.raises(ProcessLookupError):
        os.kill(int(mark.read_text()), 0)
    assert not (tmp_path / "001" / "1.json").exists()
    assert not (tmp_path / "001" / "1").exists()


@pytest.mark.parametrize("step", ["shutil.copy", "write_json"])
def test_a_full_disk_loses_no_finished_run(tmp_path, monkeypatch, step):
    section = settings(tmp_path, GOOD)
    run(tmp_path, section)
    finished = tmp_path / "001" / "1" / "out.json"
    before = finished.stat().st_mtime_ns

    def fill_the_disk(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "disk")

    with monkeypatch.context() as full:
        full.setattr(f"repose.stages.simulate.{step}", fill_the_disk)
        with pytest.raises(OSError, match="No space left"):
            run(tmp_path, section, run=2)
    # A run without a record is none: its job is made again.
    assert not (tmp_path / "001" / "2.json").exists()

    assert run(tmp_path, section, run=2)["status"] == "ok"
    run(tmp_path, section)
    assert finished.stat().st_mtime_ns == before
    folders = sorted(
        path.name for path in (tmp_path / "001").iterdir() if path.is_dir()
    )
    assert folders == ["1", "2"]


def test_the_pile_of_particles_is_measured_as_by_repose_measure(tmp_path):
    centres = cone()
    text = dump_text(centres)
    code = f"open('pile.dump', 'w').write({text!r})"
    particles = {"file": "pile.dump", "up": "z", "base": 0.0}
    section = settings(tmp_path, code, output=None, particles=particles)
    run(tmp_path, section)
    result = simulated.measure_sample(
        [tmp_path / "001" / "1.json"],
        tmp_path / "001.json",
        settings=section,
        responses=("aor_deg", "height_mm"),
        measure=SETTINGS,
    )["runs"][0]
    (tmp_path / "pile.dump").write_text(text)
    pile = measure_particles(
        particle_files.read_particles(tmp_path / "pile.dump"),
        SETTINGS,
        up="z",
        base=0.0,
    )
    assert result["aor_deg"] == pile.result.aor_deg
    assert result["height_mm"] == pile.result.height_mm

    # An automatic scale has 32 pixels across a grain.
    automatic = SETTINGS.model_copy(update={"mm_per_pixel": "auto"})
    folder = tmp_path / "001" / "1"
    fine = simulated.measure_pile(folder, section, automatic)
    scale_mm = 2e3 * RADIUS / 32
    expected = measure_particles(
        particle_files.read_particles(tmp_path / "pile.dump"),
        SETTINGS.with_scale(scale_mm),
        up="z",
        base=0.0,
    )
    assert fine["aor_deg"] == expected.result.aor_deg


@pytest.mark.parametrize(
    ("text", "status"), [(dump_text(cone()[:1]), "no_pile"), ("x", "bad_output")]
)
def test_particles_without_a_pile_are_a_failed_run(tmp_path, text, status):
    code = f"open('pile.dump', 'w').write({text!r})"
    particles = {"file": "pile.dump", "up": "z", "base": 0.0}
    section = settings(tmp_path, code, output=None, particles=particles)
    run(tmp_path, section)
    ending, numbers = simulated.read_responses(
        tmp_path / "001" / "1", section, ("aor_deg",), SETTINGS
    )
    assert ending.status == status, ending
    assert numbers == {"aor_deg": None}
