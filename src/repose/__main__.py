"""The program: `python -m repose VERB`, or `repose VERB`."""

import gc
import os
import signal
import sys

# Libraries make a hundred thousand objects that stay; to look through them for garbage
# again and again takes a tenth.
gc.set_threshold(100_000)
# Before numpy is loaded: the matrices are small, and sums split over threads end in
# other bits.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from repose.cli import main

if __name__ == "__main__":
    if sys.argv[1:2] != ["run"]:
        # Ctrl-C ends a job in the middle of a compiled loop; Python's own handler would
        # wait for the loop's end.
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        status = main()
        sys.stderr.flush()
        # Python's own end frees every object of every library first, which takes 0.1 s.
        os._exit(status)
    sys.exit(main())
