"""Tables as spreadsheets and other programs write them: each reader has the right numbers or the right sentence."""

import functools
import math
import random
import re
import statistics
import time
from pathlib import Path

import numpy as np
import pytest
import yaml
from refusals import input_error
from shared import check_all, targets_of, written

from repose.bench.parameters import PARAMETERS
from repose.calibrate.profile_targets import expand_own_profiles
from repose.calibrate.strategies.runs import read_runs
from repose.calibrate.study import Study
from repose.calibrate.uncertainty.discrepancy import estimate_from_shape_study
from repose.common import files, tables
from repose.common.errors import InputError, print_fault
from repose.common.summary_rows import find_summary_row
from repose.common.tables import Column
from repose.grain.berry import compute_mean_grain
from repose.grain.berry_files import read_compression, read_sizes
from repose.stages.parameter_sets import read_sample, read_samples
from repose.stages.published import check_published_sets, read_parameter_sets

OWN = {
    "simulator": "EDEM",
    "label": "seed",
    "seed": 1,
    "parameters": {"mus": [0.3, 0.5], "mur": [0.01, 0.05]},
    "targets": {"angle_deg": {"value": 28.4, "sd": 0.6, "repetitions": 5}},
}
SIZES = "long_mm,major_mm,minor_mm\n21.5,11.25,10.5\n22.75,12.5,11.5\n20.5,10.75,9.5\n"
TESTS = "test,force_n,length_1_mm,length_2_mm,width_1_mm,width_2_mm,breadth_mm\n"
TESTS += "1,2.5,21.5,22.5,10.5,9.5,11.5\n2,2.75,22.5,23.5,11.5,10.5,12.5\n3,1.5,20.5,21.5,9.5,8.5,10.5\n"
SETS = f"sample,{','.join(PARAMETERS)}\n" + "".join(
    f"{k},0.{k}5,0.5,0.04,0.25,0.55,0.15\n" for k in (1, 2, 3)
)
PUBLISHED = SETS.replace("sample", "solution")
ROWS = (
    f"{k},{run},0.{3 + k % 2}{k},0.0{1 + k},2{k}.{run}5\n"
    for k in (1, 2, 3, 4)
    for run in (1, 2)
)
RUNS = f"sample,run,mus,mur,angle_deg\n{''.join(ROWS)}"
MODELS = "particle,tension,filling,eligible,distance,aor_difference_deg,aor_se_deg\n"
MODELS += "".join(f"p{k},keep,open,{k < 7},0.{k}5,{k}.5,0.25\n" for k in range(8))
PROFILE = "x_mm,z_mm\n" + "".join(f"{k}.5,{9 - k}.25\n" for k in range(8))
NO_NUMBERS = (
    "1_0",
    "１２",
    "1:30",
    "0x10",
    "inf",
    "-inf",
    "1e999",
    "many",
    "1 2",
    "1.234,5",
    "2022-05-01",
)
NO_RESULTS = ("#DIV/0!", "#N/A", "########", "#WERT!")


def numbers(table):
    return table.select_dtypes("number").to_numpy(float).tolist()


def shape(path):
    """What a shape study says of one target."""
    found = estimate_from_shape_study(path, targets_of(aor_deg=30.0))
    return [found.mean.tolist(), found.covariance.tolist(), found.models]


def sets(path):
    """The published sets, once the table is checked."""
    check_published_sets(path)
    return [list(parameters.values()) for parameters in read_parameter_sets(path)]


def profile(path):
    found = expand_own_profiles(
        {"surface_mm": {"file": str(path), "sd": 0.3, "repetitions": 3}}, "own.yaml"
    )
    return [cell["value"] for cell in found.values()]


@functools.cache
def own_study():
    return Study.own(OWN)


# Reader: a good table, a column of numbers, and a function that gives its numbers.
READERS = {
    "sizes": (SIZES, "major_mm", lambda path: numbers(read_sizes(path))),
    "compression": (TESTS, "breadth_mm", lambda path: numbers(read_compression(path))),
    "samples": (SETS, "mus_gg", lambda path: numbers(read_samples(path))),
    "sample": (SETS, "mus_gg", lambda path: list(read_sample(path, 2).values())),
    "published": (PUBLISHED, "mus_gg", sets),
    "runs": (RUNS, "angle_deg", lambda path: numbers(read_runs(path, own_study()))),
    "shape study": (MODELS, "aor_difference_deg", shape),
    "profile": (PROFILE, "z_mm", profile),
}


STRANGERS = READERS | {
    "b": ("", "b", lambda path: tables.read(path, [Column("b")]).values["b"])
}


def cells(text):
    return [line.split(",") for line in text.splitlines()]


def joined(rows, separator=",", end="\n"):
    return "".join(separator.join(row) + end for row in rows)


def with_commas(rows):
    return [
        [re.sub(r"^(-?\d+)\.(\d+)$", r"\1,\2", cell) for cell in row] for row in rows
    ]


GOOD = {
    "semicolons": lambda rows: joined(rows, ";"),
    "semicolons and decimal commas": lambda rows: joined(with_commas(rows), ";"),
    "tabs": lambda rows: joined(rows, "\t"),
    "tabs and decimal commas": lambda rows: joined(with_commas(rows), "\t"),
    "blanks": lambda rows: joined(rows, " "),
    "several blanks": lambda rows: joined(rows, "   "),
    "blanks after commas": lambda rows: joined(rows, ", "),
    "blanks before commas": lambda rows: joined(rows, " ,"),
    "no-break spaces": lambda rows: joined(rows, "\N{NO-BREAK SPACE},"),
    "empty columns at the end": lambda rows: joined([[*row, "", ""] for row in rows]),
    "empty rows": lambda rows: joined(
        [rows[0], [""] * len(rows[0]), *rows[1:], [""] * len(rows[0]), [""]]
    ),
    "comments": lambda rows: (
        f'# of "mine"\n{joined(rows[:2])}# again\n{joined(rows[2:])}'
    ),
    "CRLF": lambda rows: joined(rows, end="\r\n"),
    "CR": lambda rows: joined(rows, end="\r"),
    "quotes": lambda rows: joined([[f'"{cell}"' for cell in row] for row in rows]),
    "exponents": lambda rows: joined(
        [[re.sub(r"^(\d)\.(\d+)$", r"\1.\2E+00", cell) for cell in row] for row in rows]
    ),
    "a mark of UTF-8": lambda rows: joined(rows).encode("utf-8-sig"),
    "text of Excel": lambda rows: joined(rows, "\t", "\r\n").encode("utf-16"),
    "UTF-16 of another processor": lambda rows: (
        b"\xfe\xff" + joined(rows).encode("utf-16-be")
    ),
}


def test_every_reader_reads_what_spreadsheets_write(tmp_path):
    good = {
        reader: read(written(tmp_path / "a.csv", text))
        for reader, (text, _, read) in READERS.items()
    }

    def check(reader, change):
        text, _, read = READERS[reader]
        assert good[reader]
        changed = written(tmp_path / "a.csv", GOOD[change](cells(text)))
        assert read(changed) == good[reader]

    check_all(
        check,
        [
            (f"{reader}, {change}", reader, change)
            for reader in READERS
            for change in GOOD
        ],
    )


def fault(reader, path, content):
    return str(
        input_error(
            f"^{re.escape(str(path))}", STRANGERS[reader][2], written(path, content)
        )
    )


def test_every_reader_names_row_and_column_of_what_is_no_number(tmp_path):
    def check(reader, column, value):
        rows = cells(READERS[reader][0])
        rows[2][rows[0].index(column)] = value
        assert f"row 2: {column} is '{value}'; expected " in fault(
            reader, tmp_path / "a.csv", joined(rows, ";")
        )

    cases = [
        (name, reader[1], value)
        for name, reader in READERS.items()
        for value in (*NO_NUMBERS, *NO_RESULTS)
        # An infinite response is a run that failed.
        if name != "runs" or value not in ("inf", "-inf", "1e999")
    ]
    check_all(check, [(", ".join(case), *case) for case in cases])


def test_every_measured_and_published_cell_is_a_number_that_can_be(tmp_path):
    def check(reader, column, value):
        rows = cells(READERS[reader][0])
        rows[2][column] = value
        message = fault(reader, path, joined(rows))
        if "," in value:  # the comma makes another cell of it
            assert "cells is 'Expected" in message
        else:
            assert f"row 2: {rows[0][column]} is" in message

    path = tmp_path / "a.csv"
    values = (*NO_NUMBERS, "", "nan", "-1", "1,5", "²", "None", "TRUE", "'1'")
    measured = [
        (reader, k)
        for reader, first, end in (("sizes", 0, 3), ("compression", 1, 7))
        for k in range(first, end)
    ]
    cases = [(*place, value) for place in measured for value in (*values, "0")]
    cases += [("published", k, value) for k in range(1, 7) for value in values]
    check_all(check, [(f"{case}", *case) for case in cases])


# Measured grains, and compression tests.
MEASURED = {
    "sizes": """grain,long_mm,major_mm,minor_mm
a,21.52,11.25,10.51
b,22.75,12.53,11.52
c,20.58,10.71,9.54
d,23.11,12.04,10.87
e,21.03,11.66,9.12
""",
    "compression": """test,force_n,length_1_mm,length_2_mm,width_1_mm,width_2_mm,breadth_mm
A1,2.83,21.52,22.51,10.53,9.52,11.54
A2,2.73,22.53,23.54,11.51,10.57,12.51
A3,1.58,20.51,21.52,9.58,8.51,10.52
A4,1.52,21.12,22.03,10.11,9.03,11.07
""",
}
OF_ROWS = {
    "mean": statistics.mean,
    "minimum": min,
    "maximum": max,
    "standard deviation": statistics.stdev,
}


def with_statistic(rows, name, digits=2):
    """The row that sums up the rows of a table in each of its columns."""
    columns = zip(*(map(float, row[1:]) for row in rows[1:]), strict=True)
    numbers = [f"{OF_ROWS[name](list(column)):.{digits}f}" for column in columns]
    return ["a word in any language", *numbers]


def test_a_row_at_the_end_that_repeats_a_statistic_of_the_others_is_refused(tmp_path):
    def check(reader, names):
        rows = cells(MEASURED[reader])
        summary = [with_statistic(rows, name) for name in names]
        message = fault(reader, tmp_path / "a.csv", joined([*rows, *summary]))
        assert f"row {len(rows)}: {rows[0][0]} is 'a word in any language'" in message
        assert f"this one has the {names[0]} of the rows above" in message

    cases = [[name] for name in OF_ROWS] + [["mean", "standard deviation"]]
    check_all(
        check,
        [(f"{reader}, {case}", reader, case) for reader in MEASURED for case in cases],
    )


def test_a_measurement_near_a_statistic_is_no_summary(tmp_path):
    def check(reader, row):
        rows = cells(MEASURED[reader])
        path = written(tmp_path / "a.csv", joined([*rows, row(rows)]))
        assert len(READERS[reader][2](path)) == len(rows)

    def nearly(rows):
        row = with_statistic(rows, "mean")
        return [*row[:-1], f"{float(row[-1]) + 0.02:.2f}"]

    check_all(check, [(reader, reader, nearly) for reader in MEASURED])
    # In whole millimetres an ordinary grain equals the mean.
    coarse = (
        "long_mm,major_mm,minor_mm\n21,11,10\n23,12,11\n22,12,9\n20,10,9\n22,11,10\n"
    )
    assert len(read_sizes(written(tmp_path / "a.csv", coarse))) == 5


def test_a_row_of_a_design_is_no_summary(tmp_path):
    """Its centre has the mean of all columns, a corner their ends, a repeated row both."""
    rng = np.random.default_rng(1)
    low = np.full(6, 0.11)
    high = np.full(6, 0.97)
    # eight corners: the bits of a corner's number say which of the first three columns are high
    is_high = (np.arange(8)[:, None] >> np.arange(6)) & 1
    corners = np.where(is_high, high, low)
    points = [*rng.uniform(low, high, (9, 6))]
    designs = {
        "centre": [*corners, -corners[1] + low + high, (low + high) / 2],
        "corner": [*corners, low],
        "replicates": [*np.repeat(corners, 2, axis=0), high, high],
        "repeated": [*points, high, high, low, low],
    }

    def check(design):
        rows = [[str(k), *(f"{x:.3f}" for x in row)] for k, row in enumerate(design, 1)]
        text = joined([["sample", *PARAMETERS], *rows])
        assert len(read_samples(written(tmp_path / "a.csv", text))) == len(design)

    check_all(check, list(designs.items()))


def test_a_text_among_numbers_is_refused_in_every_column(tmp_path):
    """In `grain`, which nobody reads, it tells the row of a mean from that of a grain."""
    for reader, label in (("sizes", "grain"), ("runs", "sample")):
        rows = cells(READERS[reader][0])
        if label not in rows[0]:
            rows = [[label, *rows[0]]] + [
                [str(k), *rows[k]] for k in range(1, len(rows))
            ]
        for word in ("Mean", "ø", "n/a"):
            last = [word, *rows[-1][1:]]
            message = fault(reader, tmp_path / "a.csv", joined([*rows, last]))
            assert (
                f"row {len(rows)}: {label} is '{word}'; expected a finite number, as"
                in message
            )


def test_labels_are_texts_or_numbers(tmp_path):
    path = tmp_path / "a.csv"
    for labels in (["Y", "Y", "N"], ["mean"] * 3, ["1", "b", "c"], ["", "", "12"]):
        rows = "".join(f"{k},{k},{label}\n" for k, label in enumerate(labels))
        table = tables.read(written(path, f"a,b,label\n{rows}"), [Column("b")])
        assert table.values["b"] == [0, 1, 2]
    table = tables.read(
        written(path, "b,label\n1,NA\n2,null\n"), [Column("b"), Column("label", str)]
    )
    assert list(table.frame()["label"]) == ["NA", "null"]


@pytest.mark.parametrize("cell", ["inf", "1e400", "nan", "2.5"])
def test_a_cell_of_whole_numbers_is_finite_and_whole(tmp_path, cell):
    path = written(tmp_path / "a.csv", f"n\n3.0\n{cell}\n")
    input_error("a whole number", tables.read, path, [Column("n", int)])


def test_a_column_of_whole_numbers_may_be_of_labels():
    assert tables.holds_numbers(["1", "2", ""])
    assert not tables.holds_measurements(["1", "2", ""])
    assert tables.holds_measurements(["1", "2.5", ""])
    assert not tables.holds_measurements(["a", "b", "2.5"])


def test_a_comment_is_no_row(tmp_path):
    path = tmp_path / "a.csv"
    header = "grain,long_mm,major_mm,minor_mm\n"
    rows = "".join(f"{name},9.{k},8.{k},5\n" for k, name in enumerate("abc"))
    comments = "##########\n## by hand\n# a,b,c,d\n#note\n# 2, 3\n"
    assert len(read_sizes(written(path, f"{comments}{header}{rows}"))) == 3
    # People comment out a bad row in this way.
    for line in ("#8,9,8,5", "#DIV/0!,9,8,5", "# 8,9.5,8.5,5.5"):
        assert len(read_sizes(written(path, f"{header}{rows}{line}\n"))) == 3
    message = fault("sizes", path, f"#{header}{rows}")
    assert "'#grain,long_mm,major_mm,minor_mm' has them, but is a comment" in message


def test_a_name_is_the_same_in_every_form(tmp_path):
    path = tmp_path / "a.csv"
    for found, declared in (
        ("Long_MM", "long_mm"),
        ("ho\u0308he_mm", "h\u00f6he_mm"),
        ("h\u00d6he_mm", "ho\u0308he_mm"),
        ("\u00b5s", "\u03bcs"),
        ("\u03bcs", "\u00b5s"),
        ("a\u00b2", "a2"),
        ("\u2126", "\u03a9"),
        ("long\u00a0mm", "long mm"),
        ("\u200bmus\ufeff", "mus"),
        ('"Factor 1\nA:mus"', "Factor 1 A:mus"),
    ):
        table = tables.read(written(path, f"{found},b\n1.5,2\n"), [Column(declared)])
        assert table.values[declared] == [1.5]
    written(path, "Long_mm,LONG_MM\n1,2\n")
    input_error("column long_mm is 'missing'", tables.read, path, [Column("long_mm")])
    both = tables.read(written(path, "B,b\n1,2\n"), [Column("b")])
    assert both.values["b"] == [2.0]
    assert both.values["B"] == ["1"]
    # Two parameters may differ in capitals alone.
    pair = tables.read(written(path, "E,e\n1,2\n"), [Column("e"), Column("E")])
    assert pair.values["E"] == [1.0]
    assert pair.values["e"] == [2.0]


def test_names_that_look_alike_are_told_apart_by_code_points(tmp_path):
    path = tmp_path / "a.csv"
    for found, difference in (
        ("\u0430or", "U+0430 where aor has U+0061"),
        ("a\u03bfr", "U+03BF where aor has U+006F"),
    ):
        message = fault_of_aor(written(path, f"{found},b\n1,2\n"))
        assert f"; {found} has {difference}" in message
    for found in ("b", "aox", "a or", "aor_deg"):
        assert "U+" not in fault_of_aor(written(path, f"{found},c\n1,2\n"))


def fault_of_aor(path):
    return str(input_error("column aor is", tables.read, path, [Column("aor")]))


def test_a_header_cell_of_two_lines_is_one_cell_of_one_message(tmp_path, capsys):
    text = 'Std,Run,"Factor 1\nA:mus","Response 1\naor"\n1,6,0.2,20.4\n2,9,0.2,24.6\n'
    path = written(tmp_path / "a.csv", text)
    error = input_error("column mus is 'missing'", tables.read, path, ["mus"])
    assert "found: Std, Run, Factor 1 A:mus, Response 1 aor" in str(error)
    print_fault(error)
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert tables.read(path, [Column("Factor 1 A:mus")]).values["Factor 1 A:mus"] == [
        0.2,
        0.2,
    ]


def test_tables_of_savetxt_are_read(tmp_path):
    numbers = np.random.default_rng(1).random((5, 3))
    path = tmp_path / "a.txt"
    for delimiter in (" ", "\t", ","):
        header = delimiter.join("abc")
        np.savetxt(path, numbers, header=header, comments="", delimiter=delimiter)
        table = tables.read(path, [Column(name) for name in "abc"])
        np.testing.assert_array_equal(
            np.transpose(list(table.values.values())), numbers
        )


def test_an_empty_cell_where_all_others_number_the_rows_is_refused(tmp_path):
    """In the first column it tells the row of a mean, also one that was rounded otherwise."""
    header, *measured = cells(MEASURED["sizes"])
    rows = [["no", *header[1:]]]
    rows += [[str(k), *row[1:]] for k, row in enumerate(measured, 1)]
    path = tmp_path / "a.csv"
    assert len(read_sizes(written(path, joined(rows)))) == 5
    message = fault("sizes", path, joined([*rows, ["", "21.8", "11.64", "10.31"]]))
    assert "row 6: no is ''; expected a finite number" in message
    for key in ("sample", "run"):
        table = cells(RUNS)
        table.append(list(table[-1]))
        table[-1][table[0].index(key)] = ""
        table[-1][-1] = "24.5"
        message = fault("runs", path, joined(table))
        assert f"row 9: {key} is ''; expected a number, as in the other rows" in message
    # A count that was made for some rows only numbers none.
    counts = ["broken", "3", "3", "3", "3", ""]
    counted = [[*row, count] for row, count in zip(rows, counts, strict=True)]
    assert len(read_sizes(written(path, joined(counted)))) == 5


def test_a_row_of_means_of_runs_is_refused_by_its_numbers(tmp_path):
    rng = np.random.default_rng(3)
    study = Study.own(OWN)
    low = study.parameters.low
    high = study.parameters.high
    sets = low + (high - low) * rng.random((8, 2))
    angles = rng.uniform(20, 40, (8, 1))
    rows = np.hstack([sets, angles]).round(4)
    text = "mus,mur,angle_deg\n" + "".join(
        f"{a:.4f},{b:.4f},{c:.4f}\n" for a, b, c in rows
    )
    path = tmp_path / "a.csv"
    assert len(read_runs(written(path, text), study)) == 8
    for name, statistic in (
        ("mean", np.mean),
        ("minimum", np.min),
        ("maximum", np.max),
    ):
        last = ",".join(f"{x:.4f}" for x in statistic(rows, axis=0))
        message = fault("runs", path, f"{text}{last}\n")
        assert f"this one has the {name} of the rows above" in message


def repeated_runs(sets, n_runs=2):
    """The rows of a table: two parameters and one response, several runs of each set."""
    rng = np.random.default_rng(3)
    rows = np.repeat(sets, n_runs, axis=0)
    angles = (
        20 + 20 * rows[:, :1] + 100 * rows[:, 1:] + rng.normal(0, 0.5, (len(rows), 1))
    )
    return np.hstack([rows, angles])


def text_of_runs(rows, *last_rows):
    lines = [",".join(map(repr, row)) for row in rows.tolist()]
    return "\n".join(["mus,mur,angle_deg", *lines, *last_rows, ""])


def test_a_row_of_means_below_repeated_runs_is_refused(tmp_path):
    rng = np.random.default_rng(3)
    study = Study.own(OWN)
    low = study.parameters.low
    high = study.parameters.high
    path = tmp_path / "a.csv"
    for n_sets in (4, 8):
        rows = repeated_runs(low + (high - low) * rng.random((n_sets, 2)))
        assert len(read_runs(written(path, text_of_runs(rows)), study)) == 2 * n_sets
        # Spreadsheets print 15 digits, and other programs all digits of a plain sum.
        sums = [sum(column) / len(rows) for column in rows.T.tolist()]
        for form in ("{:.4f}", "{:.15g}", "{!r}"):
            last = ",".join(map(form.format, sums))
            message = fault("runs", path, text_of_runs(rows, last))
            assert f"row {2 * n_sets + 1}: mus is" in message
            assert "this one has the mean of the rows above" in message


def test_a_run_at_the_centre_of_a_design_is_no_summary(tmp_path):
    study = Study.own(OWN)
    rows = repeated_runs(np.linspace([0.3, 0.01], [0.5, 0.05], 4))
    centre = f"0.4000,0.0300,{float(rows[:, 2].mean())!r}"
    path = written(tmp_path / "a.csv", text_of_runs(rows, centre))
    assert len(read_runs(path, study)) == 9


def test_a_further_run_of_an_earlier_set_is_no_summary():
    """Its parameter, the highest, says nothing about its two responses."""
    columns = {
        "mus": ["0.300", "0.300", "0.400", "0.400", "0.500", "0.500", "0.500"],
        "angle_deg": ["21.0", "22.0", "27.0", "25.0", "33.0", "31.0", "33.0"],
        "time_s": ["4.10", "4.20", "4.70", "4.50", "5.10", "5.30", "5.30"],
    }
    assert find_summary_row(columns) is None
    # The same responses of a new set are those of a summary.
    columns["mus"] = ["0.300", "0.310", "0.400", "0.410", "0.490", "0.500", "0.500"]
    assert find_summary_row(columns) == (6, "maximum")


def test_columns_are_described_by_number_mean_and_range(tmp_path, capsys):
    table = tables.read(written(tmp_path / "a.csv", SIZES), [Column("long_mm")])
    assert tables.describe_columns(table.values) == [
        "long_mm: 3 numbers, mean 21.58, from 20.5 to 22.75",
        "major_mm: 3 numbers, mean 11.5, from 10.75 to 12.5",
        "minor_mm: 3 numbers, mean 10.5, from 9.5 to 11.5",
    ]
    tables.print_columns(tmp_path / "a.csv")
    assert (
        "long_mm: 3 numbers, mean 21.58, from 20.5 to 22.75" in capsys.readouterr().err
    )
    marked = {
        "deg": [-1, 31.5, -1, 30.25, 29.75, -1, 33.5],
        "sample": [1, 1, 1, 2, 2, 2],
    }
    assert tables.describe_columns(marked) == [
        "deg: 7 numbers, mean 17.43, from -1 (3 times) to 33.5",
        "sample: 6 numbers, mean 1.5, from 1 to 2",
    ]
    index = {"": ["0", "1", "2"]}
    assert tables.describe_columns(index) == [
        "the column without a name: 3 numbers, mean 1, from 0 to 2"
    ]
    assert tables.describe_unread(index, hint_if_few="") == {
        tables.UNNAMED: (
            "the column without a name is not read; it has '0' once, '1' once, '2' once"
        )
    }
    failed = {"deg": ["31.5", "-nan", "nan(ind)", "Infinity", "-inf", "1e999", "28.5"]}
    assert tables.describe_columns(failed) == [
        "deg: 2 numbers, mean 30, from 28.5 to 31.5"
    ]
    assert tables.describe_columns({"deg": ["inf", "-nan"]}) == []
    labels = {"name": ["a", "b"], "mm": [1.5, math.nan, 2.5], "ok": [True], "no": []}
    assert tables.describe_columns(labels) == ["mm: 2 numbers, mean 2, from 1.5 to 2.5"]


@pytest.mark.parametrize(
    "case",
    yaml.safe_load(Path(__file__).with_name("strangers.yaml").read_text()).items(),
)
def test_a_strangers_table_is_read_or_refused_for_its_cause(case, tmp_path):
    name, (reader, text, expected) = case
    path = written(tmp_path / "a.csv", text)
    if isinstance(expected, str):
        assert expected in fault(reader, path, text), name
    else:
        assert len(STRANGERS[reader][2](path)) == expected, name


def test_many_rows_with_decimal_commas_take_seconds(tmp_path):
    path = written(
        tmp_path / "a.csv", "long_mm;major_mm;minor_mm\n" + "9,5;8,5;5,5\n" * 50_000
    )
    began = time.process_time()
    assert len(read_sizes(path)) == 50_000
    # a copy of the column for each cell took minutes
    assert time.process_time() - began < 10.0


def test_a_number_that_is_repeated_is_refused_with_both_rows(tmp_path):
    for reader, message in (
        ("compression", "row 3: test is '1'; expected each test once; row 1 has it"),
        ("samples", "row 3: sample is 1; expected each sample once; row 1 has it"),
        ("sample", "row 3: sample is 1; expected each sample once; row 1 has it"),
        (
            "published",
            "row 3: solution is '1'; expected each solution once; row 1 has it",
        ),
        (
            "runs",
            "row 3: sample and run is [1, '1']; expected each pair once; row 1 has",
        ),
    ):
        rows = cells(READERS[reader][0])
        rows[3] = [rows[1][0], *rows[3][1:]] if reader != "runs" else rows[1]
        assert message in fault(reader, tmp_path / "a.csv", joined(rows))


def test_all_faults_of_a_table_are_told_at_once_up_to_thirty(tmp_path):
    message = fault(
        "sizes",
        tmp_path / "a.csv",
        SIZES.replace("21.5", "a").replace("12.5", "b").replace("9.5", "-1"),
    )
    assert [line.rpartition("row ")[2][:1] for line in message.splitlines()] == [
        "1",
        "2",
        "3",
    ]
    assert (
        len(fault("sizes", tmp_path / "a.csv", SIZES + "x,y,z\n" * 20).splitlines())
        == 31
    )


def test_between_semicolons_and_tabs_a_comma_is_decimal(tmp_path):
    path = tmp_path / "a.csv"
    column = Column("b")
    for reader in ("sizes", "compression", "published"):
        assert "rows is 0" in fault(reader, path, READERS[reader][0].splitlines()[0])
    assert tables.read(written(path, "a\tb\n0,5\t1,234\n"), [column]).values["b"] == [
        1.234
    ]
    assert tables.read(written(path, "a;b\n1;1,234\n"), [column]).values["b"] == [1.234]


def test_a_column_is_what_it_is_declared_to_be(tmp_path):
    declared = {
        "whole": (
            Column("b", int, 1, 9),
            "a whole number from 1 to 9",
            ["1", "9", "2.0"],
            ["0", "1.5", "10", ""],
        ),
        "share": (
            Column("b", float, 0, above=True),
            "a number above 0",
            ["1e-9"],
            ["0", "-1", "nan"],
        ),
        "above": (
            Column("b", float, 2, above=True),
            "a number above 2",
            ["2.1"],
            ["2"],
        ),
        "most": (
            Column("b", high=2.0),
            "a number up to 2",
            ["-3", "2"],
            ["2.1", "-inf"],
        ),
        "nothing": (
            Column("b", may_be_empty=True),
            "a finite number, or nothing",
            ["", "NaN", "-nan", "nan(ind)"],
            ["inf", "Infinity", "x", "n/a", "nano"],
        ),
        "truth": (
            Column("b", bool),
            "True or False",
            ["TRUE", "false ", "True"],
            ["yes", "2", "", "1"],
        ),
        "words": (Column("b", words="this"), "this", ["1"], ["x"]),
    }

    def check(column, expected, cell, good):
        path = written(tmp_path / "a.csv", f"a,b\n1,{cell}\n")
        if good:
            assert len(tables.read(path, [column]).values["b"]) == 1
        else:
            input_error(
                re.escape("row 1: b is ") + f".*expected {re.escape(expected)}$",
                tables.read,
                path,
                [column],
            )

    cases = []
    for name, (column, expected, good, bad) in declared.items():
        cells_of = [(cell, True) for cell in good] + [(cell, False) for cell in bad]
        cases += [
            (f"{name} {cell!r}", column, expected, cell, is_good)
            for cell, is_good in cells_of
        ]
    check_all(check, cases)


def test_an_eligible_model_is_true_or_false_alone(tmp_path):
    expected = shape(written(tmp_path / "a.csv", MODELS))
    for cell in ("FALSE", "false", "False "):
        assert (
            shape(written(tmp_path / "a.csv", MODELS.replace("False", cell)))
            == expected
        )
    for cell in ("no", "2", "", "0"):
        message = fault(
            "shape study", tmp_path / "a.csv", MODELS.replace("False", cell)
        )
        assert f"row 8: eligible is '{cell}'; expected True or False" in message


def test_a_column_in_another_unit_is_told_with_its_file(tmp_path):
    sizes = written(tmp_path / "sizes.csv", SIZES)

    def message(tests):
        files = sizes, written(tmp_path / "tests.csv", tests)
        return str(input_error("expected", compute_mean_grain, *files, None, 840.0))

    def scaled(text, factor, *columns):
        header, *rows = cells(text)
        scaled_columns = [header.index(column) for column in columns]
        changed = (
            [
                repr(float(x) * factor) if k in scaled_columns else x
                for k, x in enumerate(row)
            ]
            for row in rows
        )
        return joined([header, *changed])

    compute_mean_grain(sizes, written(tmp_path / "tests.csv", TESTS), None, 840.0)
    for factor in (0.1, 1e-3, 1e3):
        pattern = (
            r"tests\.csv: breadth_mm is .*near that of major_mm .*: are both in mm\?"
        )
        assert re.search(pattern, message(scaled(TESTS, factor, "breadth_mm")))
    for factor in (1e-3, 1e8):
        pattern = r"tests\.csv: force_n is .*: are they in N\?"
        assert re.search(pattern, message(scaled(TESTS, factor, "force_n")))
    for column, factor in (("force_n", 1e3), ("force_n", 1e-3), ("breadth_mm", 0.1)):
        lines = TESTS.splitlines()
        one_test = f"{lines[0]}\n{lines[2]}\n"
        lines[2] = scaled(one_test, factor, column).splitlines()[1]
        pattern = rf"tests\.csv, row 2: {column} is .*of the median, "
        assert re.search(pattern, message("\n".join(lines)))
    in_half = message(scaled(TESTS, 0.1, "width_2_mm"))
    assert re.search("row 1: width_2_mm is .* at least half of it", in_half)
    shorter = message(scaled(TESTS, 0.9, "length_2_mm"))
    assert re.search("row 1: length_2_mm is 20", shorter)
    in_m = fault("sizes", sizes, scaled(SIZES, 1e-3, *cells(SIZES)[0]))
    assert re.search(r"long_mm is 0\.0215.*; expected a median from 0\.5 to 2000", in_m)
    of_one = fault("sizes", sizes, f"{SIZES}2.15,1.15,1.05\n")
    assert (
        "row 4: long_mm is 2.15; expected within a factor of 5 of the median" in of_one
    )


@pytest.mark.parametrize(
    "seeds", [range(40), pytest.param(range(40, 200), marks=pytest.mark.slow)]
)
def test_random_changes_of_good_tables_end_in_numbers_or_in_a_sentence(seeds, tmp_path):
    path = tmp_path / "a.csv"
    bits = (*',;\t"\n\r#-e.\0\ufeffé ', "# ", "nan", "1e400", "=A1", "True")

    def check(reader, seed):
        rng = random.Random(seed)
        text = READERS[reader][0]
        for _ in range(rng.randint(1, 4)):
            k = rng.randrange(len(text) + 1)
            n = rng.choice((0, 0, 1, 5, 40))
            text = text[:k] + rng.choice(("", *bits)) + text[k + n :]
        try:
            found = READERS[reader][2](written(path, text))
        except InputError as error:
            printed = str(error)
        else:
            printed = str(path)
            assert np.isfinite(np.concatenate([np.ravel(part) for part in found])).all()
        assert str(path) in printed

    check_all(
        check,
        [(f"{reader}, {seed}", reader, seed) for reader in READERS for seed in seeds],
    )


def test_what_is_no_plain_file_is_not_read(tmp_path):
    for read in (tables.read_sheet, files.read_json):
        input_error(r"/dev/zero: .* is .*a device or a pipe", read, "/dev/zero")
