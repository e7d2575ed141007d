"""What each part of the method says of its result, from made-up numbers."""

from importlib import import_module

import numpy as np
import pandas as pd
import yaml
from known import is_known
from shared import ROOT, TARGETS

from repose.calibrate.targets import Targets


def test_messages_are_known():
    def given(value):
        if value == "targets":
            return Targets.of(TARGETS)
        table = isinstance(value, list) and isinstance(value[0], dict)
        return (
            pd.DataFrame(value)
            if table
            else np.array(value)
            if isinstance(value, list)
            else value
        )

    cases = yaml.safe_load((ROOT / "tests/known/messages.yaml").read_text())
    messages = [
        import_module(case["module"]).message(*map(given, case["arguments"]))
        for case in cases
    ]
    is_known("messages.txt", "\n\n".join(messages) + "\n")
