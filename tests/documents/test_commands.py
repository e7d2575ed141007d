"""The commands of the documents are known and run; cells of their tables are short."""

import re

import commands
import pytest
import yaml
from refusals import raised
from shared import check_all, run_python

TABLE = yaml.safe_load(commands.TABLE.read_text())
KINDS = ("quick", "full", "left_out")
MOST_WORDS = 20
PAGE = """# A

Save this as `a/b.txt`.

```text
one
```

    cp a/b.txt c \\
        d  # why

    no: command
"""


def commands_of(page):
    return {
        text
        for kind, text in commands.steps((commands.ROOT / page).read_text())
        if kind == "command"
    }


def test_the_table_holds_the_commands_of_every_page():
    def same(page):
        known = [text for name in KINDS for text in TABLE.get(page, {}).get(name) or ()]
        assert sorted(known) == sorted(commands_of(page))

    check_all(same, [(page, page) for page in sorted({*commands.pages(), *TABLE})])
    assert all(
        reason
        for entry in TABLE.values()
        for reason in (entry.get("left_out") or {}).values()
    )


def test_files_commands_and_pictures_of_a_page_come_in_their_order():
    expected = [("heading", "# A"), ("a/b.txt", "one\n"), ("command", "cp a/b.txt c d")]
    assert list(commands.steps(PAGE)) == expected
    for page, entry in TABLE.items():
        if "pictures" in entry:
            folder = (commands.ROOT / page).parent
            shown = re.findall(
                r"!\[[^]]*\]\(([^)]+)\)", (commands.ROOT / page).read_text()
            )
            paths = {
                str(folder.joinpath(target).resolve().relative_to(commands.ROOT))
                for target in shown
            }
            assert paths == set(entry["pictures"]), page
            assert [
                path for path in paths if not (commands.ROOT / path).is_file()
            ] == [], page


def test_the_folder_that_the_tutorial_makes_in_the_checkout_is_ignored():
    page = (commands.ROOT / "docs/tutorials/own_crop.md").read_text()
    (folder,) = re.findall(r"repose new (\S+)", page)
    assert f"/{folder}/" in (commands.ROOT / ".gitignore").read_text().splitlines()


def test_every_shown_output_has_its_block_and_its_lines():
    pages = [page for page, entry in TABLE.items() if "printed" in entry]
    assert pages
    for page in pages:
        printed = TABLE[page]["printed"]
        assert set(printed) <= set(TABLE[page]["full"]), page
        text = (commands.ROOT / page).read_text()
        for command, (start, end) in commands.find_printed(text, printed).items():
            lines = text.splitlines()[start:end]
            assert lines, command
            assert all(re.search(printed[command], line) for line in lines), command


def test_what_a_command_prints_is_compared_and_written(tmp_path, monkeypatch):
    page = PAGE + "\n    repose a\n\nIt prints\n\n```text\npile 25.1 deg, 3\n```\n"
    (tmp_path / "page.md").write_text(page)
    monkeypatch.setattr(commands, "ROOT", tmp_path)
    commands.compare_printed("page.md", {"repose a": ["pile 24.8 deg, 3"]})
    others = (["pile 45.1 deg, 3"], ["heap 25.1 deg, 3"], ["pile 25.1 deg, 3", "more"])
    for other in others:
        raised(
            SystemExit,
            "page.md: `repose a` prints otherwise",
            commands.compare_printed,
            "page.md",
            {"repose a": other},
        )
        text = commands.show_printed(page, {"repose a": other})
        assert text == page.replace("pile 25.1 deg, 3", "\n".join(other))

    entry = {"full": ["cp a/b.txt c d"], "printed": {"cp a/b.txt c d": "^o"}}
    entry["quick"] = ["repose a"]
    text = commands.script("page.md", entry, everything=True)
    assert 'cp a/b.txt c d 2>&1 | tee "$page"/page_0.printed\n' in text
    assert "tee" not in commands.script("page.md", entry, everything=False)
    (tmp_path / "page_0.printed").write_text("one\ntwo\n")
    shown = commands.read_printed("page.md", entry, tmp_path)
    assert shown == {"cp a/b.txt c d": ["one"]}


@pytest.mark.parametrize(
    ("sentence", "names"),
    [
        ("Save this as `a.txt`:", ["a.txt"]),
        ("Save the following as `a.txt`, in place of the old file:", ["a.txt"]),
        ("Then save this small study as `a.yaml`.", ["a.yaml"]),
        ("Save your results as `a.csv`.", []),
        ("Save it as `a.csv`.", []),
    ],
)
def test_a_sentence_that_shows_a_file_names_it(sentence, names):
    files = [
        kind
        for kind, _ in commands.steps(f"{sentence}\n\n```text\none\n```\n")
        if kind not in ("heading", "command")
    ]
    assert files == names


@pytest.mark.essential
@pytest.mark.slow
def test_the_quick_commands_run():
    assert "README.md" in run_python(commands.__file__)


# A study of another grain, which is read over the shared method, and a variant of the goji berry, which is small.
LOADS = """
from repose.config.pipeline import PipelineConfig
import repose, pathlib
assert pathlib.Path(repose.__file__).is_relative_to(pathlib.Path.cwd())
assert "drum" not in PipelineConfig.load("examples/lammps_pile/pile.yaml").config
assert PipelineConfig.load("config/matched.yaml").config["funnel"]["berries"] == 100
"""


@pytest.mark.slow
def test_commands_of_a_checkout_run_its_own_program_with_the_small_study(tmp_path):
    folder = commands.checkout(tmp_path / "checkout")
    commands.run("page.md", f"python - <<'END'\n{LOADS}\nEND", folder)


def test_a_command_that_fails_is_named_with_its_page(tmp_path):
    raised(
        SystemExit,
        r"page\.md: status 3\d*",
        commands.run,
        "page.md",
        "set -e\nexit 31",
        tmp_path,
    )


def long_cells(page, text):
    fenced = False
    for number, line in enumerate(text.splitlines(), 1):
        fenced ^= line.lstrip().startswith("```")
        if not fenced and line.lstrip().startswith("|"):
            for cell in re.split(r"(?<!\\)\|", line):
                if len(cell.split()) > MOST_WORDS:
                    yield f"{page}:{number}: {len(cell.split())} words: {cell.strip()}"


def test_no_cell_of_a_table_has_more_than_20_words():
    # those tables are results
    pages = [page for page in commands.pages() if not page.startswith("tests/")]
    found = [
        cell
        for page in pages
        for cell in long_cells(page, (commands.ROOT / page).read_text())
    ]
    assert not found, "\n".join(found)
    line = f"| a | {'word ' * 21}|"
    assert len(list(long_cells("page", line))) == 1
    assert not list(long_cells("page", f"```\n{line}\n```"))
