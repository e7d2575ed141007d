"""Tables of the documents are tables: their cells are short."""

import re

import commands

MOST_WORDS = 20


def long_cells(page, text):
    fenced = False
    for number, line in enumerate(text.splitlines(), 1):
        fenced ^= line.lstrip().startswith("```")
        if not fenced and line.lstrip().startswith("|"):
            for cell in re.split(r"(?<!\\)\|", line):
                if len(cell.split()) > MOST_WORDS:
                    yield f"{page}:{number}: {len(cell.split())} words: {cell.strip()}"


def test_no_cell_of_a_table_has_more_than_20_words():
    pages = [page for page in commands.pages() if not page.startswith("tests/")]  # those tables are results
    found = [cell for page in pages for cell in long_cells(page, (commands.ROOT / page).read_text())]
    assert not found, "\n".join(found)


def test_a_long_cell_is_found_and_a_fenced_one_is_not():
    line = f"| a | {'word ' * 21}|"
    assert len(list(long_cells("page", line))) == 1
    assert not list(long_cells("page", f"```\n{line}\n```"))
