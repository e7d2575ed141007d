"""Studies that judged the method: run from a checkout, and no part of the wheel."""

import os

# As in `repose.__main__`, before numpy is loaded: sums split over threads end in other bits.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
