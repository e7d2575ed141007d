"""The program: `python -m repose VERB`, or `repose VERB`."""

import os
import signal
import sys

# Before numpy is loaded: the matrices are small, and sums split over threads end in other bits.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from repose.cli import main

if __name__ == "__main__":
    if sys.argv[1:2] != ["run"]:
        # Ctrl-C ends a job in the middle of a compiled loop; Python's own handler would wait for the loop's end.
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.exit(main())
