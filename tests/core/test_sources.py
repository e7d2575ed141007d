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
    assert not [path for path in search if path.startswith(("config/", "core/", "cli/", "pictures/"))]
    assert "measure/angles.py" in closure("measure_runs", monkeypatch)  # through the bench test
    assert "particle/support_fit.py" in closure("shape", monkeypatch)  # through a helper of the command line
    assert "strategies/sequential/kriging.py" not in closure("network", monkeypatch)
