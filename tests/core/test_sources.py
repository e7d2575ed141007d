"""What a stage stands on: the modules that its verb uses, found from the imports."""

from repose.core import sources


def closure(verb, monkeypatch):
    """Files whose hash a stage has."""
    files = []
    monkeypatch.setattr(sources, "_hash", lambda paths: files.extend(paths))
    sources.stage_hash.__wrapped__(verb)
    return {path.relative_to(sources.PACKAGE).as_posix() for path in files}


def test_a_stage_stands_on_what_its_verb_imports_and_on_what_that_imports(monkeypatch):
    search = closure("miga", monkeypatch)
    assert {"chain/invert.py", "search/miga.py", "search/objective.py", "surrogate/two_layer.py"} <= search
    assert {"core/targets.py", "core/parameter_space.py"} <= search
    assert "core/variance.py" in closure("noise", monkeypatch)
    assert not [path for path in search if path.startswith(("config/", "core/files", "cli/", "pictures/"))]
    assert "measure/angles.py" in closure("measure_runs", monkeypatch)  # through the bench test
    assert "particle/support_fit.py" in closure("shape", monkeypatch)  # through a helper of the command line
    assert "strategies/sequential/kriging.py" not in closure("network", monkeypatch)
    # modules of a package that imports them by their names, and relatively
    figures = {f"pictures/figures/{name}.py" for name in ("style", "search", "plane")}
    assert figures <= closure("figure", monkeypatch)


def test_the_engines_hash_has_all_that_a_pour_imports_besides_measurement_and_what_all_share():
    waiting = [path for room in ("dem", "apparatus") for path in (sources.PACKAGE / room).rglob("*.py")]
    outside = {
        file.relative_to(sources.PACKAGE).as_posix() for path in waiting for file in sources._imported(path)
    }
    others = {path for path in outside if not path.startswith(("dem/", "apparatus/", "measure/", "core/"))}
    assert {path for path in others if not path.endswith("__init__.py")} - set(sources.ENGINE) == set()
