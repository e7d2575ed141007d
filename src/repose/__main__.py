"""The program: `python -m repose VERB`, or `repose VERB`."""

import os
import sys

# Before numpy is loaded: the matrices are small, and sums split over threads end in other bits.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from repose.cli import main

if __name__ == "__main__":
    sys.exit(main())
