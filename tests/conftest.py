import importlib
import os
import sys
from pathlib import Path

# As in `repose.__main__`, and before numpy is loaded: threads that wait for each other on small matrices cost minutes.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parent))
importlib.import_module("repose.apparatus")  # makes the responses known by name
