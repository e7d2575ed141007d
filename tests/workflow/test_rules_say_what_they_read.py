"""A rule says the keys that its stage reads, as `stands_on.KEYS` has them for the record of provenance."""

import re

from plans import ROOT

from repose.config import stands_on

RULE = re.compile(r"^ *(?:use rule|rule|checkpoint)\b", re.MULTILINE)
# The rule `measure` says the one section of both.
OTHERWISE = {"silhouette", "measure_silhouette"}


def test_the_keys_of_each_rule_are_those_of_its_stage():
    said = {}
    for path in (ROOT / "workflow/rules").rglob("*.smk"):
        for rule in RULE.split(path.read_text()):
            for stage in re.findall(r"python -m repose (?:stage )?(\w+)", rule):
                for words in re.findall(r"depends=reads\(([^)]*)\)", rule):
                    said[stage] = tuple(re.findall(r'"([^"]+)"', words))
    assert said == {stage: keys for stage, keys in stands_on.KEYS.items() if stage not in OTHERWISE}
