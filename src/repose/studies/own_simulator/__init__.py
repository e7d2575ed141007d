"""A simulator of the user's own: samples out, a table of responses in, and the same answer as of a whole run.

Any simulator and any responses will do: parameters and targets are columns of the user's table::

    study = read_study("own.yaml")
    table = first_runs(study)                       # to simulate
    runs = checked_runs(study, table_with_responses)
    advice, following = ask(study, runs)            # the next runs, until advice.stop
    found = calibrate(study, runs)
"""

from repose.studies.own_simulator.calibration import Calibration, ask, calibrate
from repose.studies.own_simulator.noise import noise_of
from repose.studies.own_simulator.runs import checked_runs, first_runs, read_runs, tell
from repose.studies.own_simulator.study import OwnStudy, read_study, study_of

__all__ = [
    "Calibration",
    "OwnStudy",
    "ask",
    "calibrate",
    "checked_runs",
    "first_runs",
    "noise_of",
    "read_runs",
    "read_study",
    "study_of",
    "tell",
]
