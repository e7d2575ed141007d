"""What each part of the method says of its result, from made-up numbers."""

from importlib import import_module

import numpy as np
import pandas as pd
import yaml
from known import is_known
from shared import ROOT, TARGETS

from repose.calibrate.targets import Targets


def test_messages_are_known():
    def argument(value):
        """Lists of mappings stand for tables in the file, other lists for arrays."""
        if value == "targets":
            return Targets.of(TARGETS)
        if not isinstance(value, list):
            return value
        if isinstance(value[0], dict):
            return pd.DataFrame(value)
        return np.array(value)

    cases = yaml.safe_load((ROOT / "tests/known/messages.yaml").read_text())
    messages = []
    for case in cases:
        describe = getattr(import_module(case["module"]), case["function"])
        messages.append(describe(*map(argument, case["arguments"])))
    is_known("messages.txt", "\n\n".join(messages) + "\n")
