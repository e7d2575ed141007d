"""Every key of the configuration with values that it cannot take, made from the schema by rule; and bad YAML."""

import ast
import copy
import difflib
import math

import pytest
from refusals import input_error
from shared import at, check_all, every_bench_test, put, says

from repose.bench import bench_tests
from repose.bench.parameters import LAW_PARAMETERS, PARAMETERS
from repose.common import faults
from repose.common.errors import InputError, YamlError
from repose.common.reading import parse_yaml
from repose.config.computed import COMPUTED_SETTINGS
from repose.config.models import make_settings_type
from repose.config.pipeline import PipelineConfig

NULL = {"type": "null"}
AUTO = {"const": "auto", "type": "string"}


def good():
    return copy.deepcopy(every_bench_test()) | {
        "figures": {"format": ["png", "pdf"], "dpi": 300}
    }


def resolved(schema):
    """A schema with its references followed, and that of its numbers where it may also be null or auto."""
    while "$ref" in schema:
        schema = faults.make_schema(make_settings_type())["$defs"][
            schema["$ref"].rsplit("/", 1)[1]
        ]
    others = [kind for kind in schema.get("anyOf", []) if kind not in (NULL, AUTO)]
    if len(others) != 1:
        return schema
    found = resolved(others[0])
    return (
        found | {"type": [found["type"], "null"]} if NULL in schema["anyOf"] else found
    )


def entries(schema, prefix=""):
    """Pairs (dotted key, schema) of all keys, those of a section after it."""
    for key, child in schema["properties"].items():
        child = resolved(child)
        name = f"{prefix}{key}"
        yield name, child
        if "properties" in child:
            yield from entries(child, f"{name}.")


def leaves():
    """Entries with values, so neither sections nor those of the research, which have any keys; and keys of a target."""
    found = {
        key: field
        for key, field in entries(faults.make_schema(make_settings_type()))
        if "properties" not in field and field.get("type") != "object"
    }
    of_target = resolved(found["targets"]["items"])["properties"]
    return [
        *found.items(),
        *((f"targets.0.{key}", resolved(schema)) for key, schema in of_target.items()),
    ]


def sections():
    return [
        name
        for name, schema in entries(faults.make_schema(make_settings_type()))
        if "properties" in schema
    ]


def bad_values(schema):
    """Pairs (what is wrong, value) that no key of this schema takes."""
    kinds = schema.get("type", [])
    kinds = [kinds] if isinstance(kinds, str) else kinds
    yield "a mapping", {"no_such_key": 1}
    yield "nested lists", [[1]]
    if "null" not in kinds:
        yield "nothing", None
    if {"number", "integer"} & set(kinds) and "enum" not in schema:
        yield from (
            ("text", "many"),
            ("not a number", math.nan),
            ("infinite", math.inf),
            ("true", True),
        )
        low = schema.get("minimum", schema.get("exclusiveMinimum"))
        yield "too small", low - 1
        yield "too large", schema["maximum"] + 1
        if "integer" in kinds:
            yield "a fraction", schema["maximum"] - 0.5
        if "exclusiveMinimum" in schema:
            yield "its bound", low
    elif "boolean" in kinds:
        yield from (("text", "yes"), ("a number", 1))
    elif "string" in kinds or "enum" in schema:
        yield from (
            ("a number", 3.5),
            ("empty", ""),
            ("true", True),
            ("a line", "a\nb"),
        )
        if "enum" in schema:
            yield from (
                ("no choice of it", "something else"),
                ("capitals", str(schema["enum"][0]).upper() + "X"),
            )
    else:
        yield from (
            ("text", "something else"),
            ("empty", []),
            ("not a number", math.nan),
            ("negative", -1),
        )
        if "anyOf" in schema or "array" in kinds:
            yield from (
                ("infinite", math.inf),
                ("texts", ["a", "b"]),
                ("pairs of nothing", [None, None]),
            )


def faults_of(config):
    error = input_error("mine.yaml", PipelineConfig.of, config, "mine.yaml")
    found = getattr(error, "faults", [error])
    assert all(fault.source == "mine.yaml" and fault.allowed for fault in found)
    return {fault.key: fault for fault in found}


def test_every_key_refuses_what_it_cannot_take():
    def check_reported(keys):
        config = good()
        for key, value in keys.items():
            put(config, key, value)
        faults = faults_of(config)
        missed = [
            key
            for key in keys
            if not any(f"{fault}.".startswith(f"{key}.") for fault in faults)
        ]
        assert not missed

    kinds = {}
    for key, schema in leaves():
        for wrong, value in bad_values(schema):
            if not (key.startswith("targets.0.") and wrong in ("empty", "a line")):
                # a list that is replaced has no entries of its own to break
                kinds.setdefault(
                    f"{wrong} (targets)" if key == "targets" else wrong, {}
                )[key] = value
    check_all(check_reported, [(wrong, keys) for wrong, keys in kinds.items()])


OPTIONAL = (
    "constraints",
    "simulation.contact_law",
    "simulation.rolling_law",
    "figures.format",
    "figures.dpi",
    *(
        f"{test.name}.{key}"
        for test in bench_tests()
        for key, field in test.settings.model_fields.items()
        if not field.is_required()
    ),
    *(f"parameters.{name}" for name in LAW_PARAMETERS),
    *(setting.key for setting in COMPUTED_SETTINGS),
    *("berry.mean_size", "note"),  # absent in results of earlier versions
)


def test_every_missing_key_is_reported():
    def missing(key):
        config = good()
        section, _, last = key.rpartition(".")
        del at(config, section)[last]
        assert "the key is missing" in faults_of(config)[key].allowed

    required = [
        key
        for key, _ in leaves()
        if not key.startswith("targets.") and key not in OPTIONAL
    ]
    required += [
        name
        for name in sections()
        if name in faults.make_schema(make_settings_type())["required"]
    ]
    check_all(missing, [(key, key) for key in required])


def test_an_unknown_key_is_reported_in_every_section():
    def unknown(section, extra):
        key = f"{section}.{extra}" if section else str(extra)
        config = good()
        at(config, section)[extra] = 1
        assert "a known key" in faults_of(config)[key].allowed

    places = ("", *sections(), "targets.0")
    extras = ("no_such_key", "", "seeds ", 3)
    check_all(
        unknown,
        [(f"{place} {extra!r}", place, extra) for place in places for extra in extras],
    )


def test_every_section_is_a_mapping():
    def refused(section, value):
        assert section in faults_of(put(good(), section, value))

    cases = [
        (section, value) for section in sections() for value in (None, [], "text", 3)
    ]
    check_all(
        refused, [(f"{section} {value!r}", section, value) for section, value in cases]
    )


def test_all_faults_are_reported_at_once():
    config = good()
    keys = (
        "funnel.seeds",
        "simulation.gravity_m_s2",
        "label",
        "miga.islands",
        "targets.0.sd",
        "drum.no_such_key",
    )
    for key in keys:
        put(config, key, -1)
    del config["sensitivity"]["seed"]
    assert {*keys, "sensitivity.seed"} == set(faults_of(config))


def test_contradictions_of_keys_are_reported_at_once():
    config = good()
    config["funnel"] |= {"outlet_diameter_mm": 150.0, "rest_window_s": 18.0}
    config["miga"]["tournament"] = 900
    config["network"]["split"] = [0.5, 0.1, 0.1]
    messages = faults_of(config)
    assert {
        "funnel.outlet_diameter_mm",
        "funnel.rest_window_s",
        "miga.tournament",
        "network.split",
    } <= set(messages)


NO_CONFIGURATIONS = (
    # no mapping
    b"",
    b"\n",
    b"# only a comment\n",
    b"null\n",
    b"3\n",
    b"- 1\n",
    b"text\n",
    b"[1, 2]\n",
    b"label: ! \n",
    # bytes that are no text
    b"label: mine\0\n",
    b"label: \x01\n",
    b"\xff\xfe",
    "label: mine\n".encode("utf-16"),
    b"label: \xe9\n",
    # keys that are no text, or there twice
    b"? [a, b]\n: 1\n",
    b"? {a: 1}\n: 1\n",
    b"{a, b}: 1\n",
    b"label: mine\nlabel: yours\n",
    b"funnel: {seeds: 2, seeds: 3}\n",
    b"<<: 3\n",
    b"<<: {a: 1}\n",
    # no YAML
    b"'a': 'b': 'c'\n",
    b"funnel:\n\tseeds: 2\n",
    b"funnel: [\n",
    b"funnel: {\n",
    b"label: 'a\n",
    b"label: &a [*a]\n",
    b"label: *nothing\n",
    b'{"label": "mine"',
    b'{"label" "mine"}',
    b"--- a: 1\n--- b: 2\n",
    b"---\na: 1\n---\nb: 2\n",
    b"%YAML 9\n---\na: 1\n",
    b"[" * 1200,
    b"{a: " * 1200,
    b"a: " * 100,
    # values of another kind
    b"funnel: seeds\n",
    b"funnel: {seeds}\n",
    b"funnel: {seeds: 0x}\n",
    b"label: 1:30\n",
    b"label: 2026-13-45\n",
    # tags
    b"!!python/object:os.system x\n",
    b"a: !!python/name:os.system\n",
    b"a: !!binary x\n",
    b"a: !!int x\n",
    b"a: !!int ''\n",
    b"a: !!float ''\n",
    b"a: !!bool x\n",
    b"a: !!null x\n",
    b"a: !!timestamp x\n",
    b"a: !!set [1]\n",
    b"a: !!omap x\n",
)


def test_text_that_is_no_configuration(refused, tmp_path):
    def check(text):
        (tmp_path / "mine.yaml").write_bytes(text)
        assert "mine.yaml" in refused("check", "--config", "mine.yaml")

    check_all(check, [(text[:40], text) for text in NO_CONFIGURATIONS])


@pytest.mark.parametrize(
    "text",
    [
        b"null: 3\n",
        b"~: 3\n",
        b"1.5: 3\n",
        b"funnel: {null: 3}\n",
        b"funnel: {1.5: 3}\n",
    ],
)
def test_a_key_that_is_no_text_is_answered(text, tmp_path):
    (tmp_path / "odd.yaml").write_bytes(text)
    input_error(
        r"odd\.yaml: (funnel\.)?(None|1\.5) is 3; expected a known key",
        PipelineConfig.load,
        tmp_path / "odd.yaml",
    )


def test_aliases_that_multiply_end_in_a_short_message_at_once_and_plain_ones_are_fine(
    refused, tmp_path
):
    for levels in (4, 5, 6, 9, 60):  # each list holds the one before nine times
        lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
        lines += [
            f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]" for k in range(1, levels)
        ]
        (tmp_path / "mine.yaml").write_text("\n".join(lines))
        message = refused("check", "--config", "mine.yaml")
        assert len(message) < 10_000, levels
        assert ("every alias is replaced" in message) == (levels > 5), levels
    expected = [{"b": [1, 2]}] * 2
    assert parse_yaml("a: &a {b: [1, 2]}\nc: [*a, *a]", "mine.yaml")["c"] == expected


def test_a_message_shows_a_large_value_in_part_and_a_small_one_as_it_is():
    nested = ["x"]
    for _ in range(40):
        nested = [nested] * 10
    for value in (nested, ["x" * 9] * 10**5, {"a": nested}, "x" * 10**6, 10**4000):
        for kind in (InputError, YamlError):
            assert len(str(kind("mine.yaml", "key", value, "a number"))) < 600
    for value in (
        "text",
        1.5,
        None,
        [31, 34],
        {"b": [1, 2], "a": 2.5},
        [[1, 2], [3, 4]],
    ):
        message = str(InputError("mine.yaml", "key", value, "a number"))
        shown = message.removeprefix("mine.yaml: key is ").removesuffix(
            "; expected a number"
        )
        assert ast.literal_eval(shown) == value


def test_nothing_to_calibrate_is_reported(refused, tmp_path):
    fixed = "".join(f"  {name}: {{fixed: 0.3}}\n" for name in PARAMETERS)
    (tmp_path / "mine.yaml").write_text(f"parameters:\n{fixed}")
    for arguments in (["check"], ["plan"], ["stage", "propose", "sequential"]):
        message = refused(*arguments, "--config", "mine.yaml")
        assert len(message.splitlines()) == 1
        says(message, "mine.yaml: parameters is ", "at least one free parameter")


def test_thousands_of_unknown_keys_take_as_many_guesses_as_are_reported(
    config, monkeypatch
):
    """A file of another program would otherwise take minutes."""
    words = []
    guess = difflib.get_close_matches

    def counted(word, *arguments):
        words.append(word)
        return guess(word, *arguments)

    monkeypatch.setattr(difflib, "get_close_matches", counted)
    for number in range(2000):
        config[f"unknown_{number}"] = 1
    message = str(input_error("unknown_0", PipelineConfig.of, config, "a.yaml"))
    assert "a.yaml: 1970 more faults" in message
    assert len(words) == 30


@pytest.mark.parametrize("content", [5, [1], None, "text"])
def test_a_configuration_without_keys_is_refused_as_a_whole(content):
    [fault] = faults.find_faults(content, "a.yaml", make_settings_type()).faults
    assert str(fault).endswith("expected keys with values")
