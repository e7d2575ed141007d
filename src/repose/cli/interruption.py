"""End `repose run` in order at a signal: Ctrl-C, a cluster's limit, a closed terminal.

Snakemake lets its jobs go on at SIGTERM, and knows nothing of SIGHUP. Here both end the
run as Ctrl-C does: what is finished stays, and the jobs that run are ended.
"""

import contextlib
import os
import signal
import threading
import time
from types import FrameType, TracebackType
from typing import TYPE_CHECKING, Self

if TYPE_CHECKING:
    import psutil

END_BYTE = b"\0"  # no signal has the number 0: it ends the thread that reads signals
# Interval at which jobs are looked for that started after the signal.
SEARCH_INTERVAL_S = 0.5
# Time after which a job that still runs gets the signal again. A process that is about
# to become another program loses the signals that it has.
REPEAT_AFTER_S = 3.0
# Time in which a thread begins that was about to start at the signal.
THREAD_START_LIMIT_S = 5.0


class Interruption:
    """Turns the first signal within its context into a `KeyboardInterrupt`.

    Attributes
    ----------
    signal_number : int or None
        The signal that ended the run; None if none did.
    """

    def __init__(self) -> None:
        self.signal_number: int | None = None
        # When each job got its last signal [s].
        self._interrupted_at: dict[psutil.Process, float] = {}
        self._has_ended = threading.Event()

    def __enter__(self) -> Self:
        self._earlier_threads = set(threading.enumerate())
        # A process under nohup ignores SIGHUP, and must continue to ignore it.
        self._forwarded_signals = [
            number
            for number in (signal.SIGTERM, signal.SIGHUP)
            if signal.getsignal(number) is not signal.SIG_IGN
        ]
        earlier_handler = signal.signal(signal.SIGINT, self._interrupt)
        self._earlier_handlers = {signal.SIGINT: earlier_handler}
        for number in self._forwarded_signals:
            self._earlier_handlers[number] = signal.signal(number, lambda *_: None)

        # Snakemake replaces the handler of SIGTERM. Python still writes the number of
        # every signal into this pipe, and a thread reads it there.
        self._reading_end, self._writing_end = os.pipe()
        os.set_blocking(self._writing_end, False)
        self._earlier_wakeup_fd = signal.set_wakeup_fd(
            self._writing_end, warn_on_full_buffer=False
        )
        self._thread = threading.Thread(target=self._forward, daemon=True)
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self.signal_number is not None:
            self._wait_for_threads()
        # Restore the earlier handlers, and then end the thread that reads the pipe.
        self._has_ended.set()
        signal.set_wakeup_fd(self._earlier_wakeup_fd)
        for number, handler in self._earlier_handlers.items():
            signal.signal(number, handler)
        os.write(self._writing_end, END_BYTE)
        self._thread.join()
        os.close(self._reading_end)
        os.close(self._writing_end)

    def _forward(self) -> None:
        """Send SIGINT to this process at a signal that would not end Snakemake."""
        while True:
            # Each signal is one byte. `os.read` blocks until the next one.
            number = os.read(self._reading_end, 1)[0]
            if number == END_BYTE[0]:
                return
            if number in self._forwarded_signals and self.signal_number is None:
                self.signal_number = number
                os.kill(os.getpid(), signal.SIGINT)

    def _interrupt(self, number: int, _frame: FrameType | None) -> None:
        """Handle SIGINT: end the jobs, and raise KeyboardInterrupt."""
        # only once: a second Ctrl-C ends this program at once
        signal.signal(number, signal.SIG_DFL)
        if self.signal_number is None:
            self.signal_number = number
        self._interrupt_jobs()
        # The exception may be lost where a library catches it, and Snakemake may just
        # have been about to start a job.
        threading.Thread(target=self._interrupt_new_jobs, daemon=True).start()
        raise KeyboardInterrupt

    def _interrupt_new_jobs(self) -> None:
        """Interrupt jobs that start after the signal, until the run has ended."""
        while not self._has_ended.wait(SEARCH_INTERVAL_S):
            self._interrupt_jobs()

    def _wait_for_threads(self) -> None:
        """Wait for the threads of the run, while the jobs that they start are ended.

        Snakemake runs each job in a thread and waits for these threads. If the exception
        comes while it starts one, it does not know the thread, and ends before the job
        begins. Python waits for such a thread at its own end, when nobody would interrupt
        the job.
        """
        # A thread that is still to begin at the limit never will: the exception came
        # before the system had made it.
        limit = time.monotonic() + THREAD_START_LIMIT_S
        while any(
            thread.is_alive() or time.monotonic() < limit
            for thread in threading.enumerate()
            if thread not in self._earlier_threads and not thread.daemon
        ):
            time.sleep(0.05)

    def _interrupt_jobs(self) -> None:
        """Send SIGINT to each job, for which Snakemake waits, and again to a slow one.

        Ctrl-C on a terminal has reached them; a signal to this program alone has not.
        """
        import psutil  # of the extra `workflow`

        now = time.monotonic()
        for job in psutil.Process().children(recursive=True):
            earlier = self._interrupted_at.get(job)
            if earlier is None or now - earlier >= REPEAT_AFTER_S:
                self._interrupted_at[job] = now
                with contextlib.suppress(psutil.NoSuchProcess):
                    job.send_signal(signal.SIGINT)
