"""Compiled code of these benchmarks in a folder of its own: import it before `repose`.

Numba's index of compiled kernels names the module of each law. Beside the usual code, the laws of `peer_laws.py` would
make that index unreadable wherever this module is not found.
"""

import os
import sys
import tempfile
from pathlib import Path

if "repose.dem" not in sys.modules:
    os.environ["NUMBA_CACHE_DIR"] = str(Path(tempfile.gettempdir()) / "repose-peer-laws")
