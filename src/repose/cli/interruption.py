"""End `repose run` cleanly after Ctrl-C, a cluster's time limit or a closed terminal.

After SIGTERM Snakemake waits for its jobs, and it does not handle SIGHUP. With this
module both signals act like Ctrl-C: finished results are kept, and running jobs are
ended.
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

# Ends the thread that reads the numbers of signals. No signal has the number 0.
END_BYTE = b"\0"
# Interval at which this module searches for jobs that started after the signal.
SEARCH_INTERVAL_S = 0.5
# A job that still runs after this time gets the signal again, because a process loses
# its signals while it becomes another program.
REPEAT_AFTER_S = 3.0
# A thread that was about to start when the signal arrived begins within this time.
THREAD_START_LIMIT_S = 5.0


class Interruption:
    """A context in which the first signal raises `KeyboardInterrupt` and ends all jobs.

    Attributes
    ----------
    signal_number : int or None
        The signal that ended the run; None if there was no signal.
    """

    def __init__(self) -> None:
        self.signal_number: int | None = None
        # The time when each job got its last signal [s].
        self._interrupted_at: dict[psutil.Process, float] = {}
        self._has_ended = threading.Event()

    def __enter__(self) -> Self:
        """Handle the signals, and start the thread that forwards SIGTERM and SIGHUP.

        `__exit__` undoes each of these steps.
        """
        # Later threads belong to the run, and `_wait_for_threads` waits for them.
        self._earlier_threads = set(threading.enumerate())
        # A process under nohup ignores SIGHUP, and must continue to ignore it.
        self._forwarded_signals = [
            number
            for number in (signal.SIGTERM, signal.SIGHUP)
            if signal.getsignal(number) is not signal.SIG_IGN
        ]

        # Replace the handlers, and remember the earlier ones. The handler of a forwarded
        # signal does nothing, because the thread that is started below also gets the
        # number of the signal and acts on it. Without a handler the signal would end
        # this process.
        earlier_handler = signal.signal(signal.SIGINT, self._handle_interrupt)
        self._earlier_handlers = {signal.SIGINT: earlier_handler}
        for number in self._forwarded_signals:
            self._earlier_handlers[number] = signal.signal(number, lambda *_: None)

        # Snakemake will replace the handler of SIGTERM, so the handler is not enough.
        # Whatever the handler does, Python writes the number of each signal into the
        # wakeup file descriptor, here the writing end of a pipe. A thread reads the
        # numbers at the other end. The pipe must exist before the thread starts. Python
        # requires that writing to it never blocks.
        self._reading_end, self._writing_end = os.pipe()
        os.set_blocking(self._writing_end, False)
        self._earlier_wakeup_fd = signal.set_wakeup_fd(
            self._writing_end, warn_on_full_buffer=False
        )
        self._thread = threading.Thread(target=self._forward_signals, daemon=True)
        self._thread.start()
        return self

    def __exit__(
        self,
        exception_type: type[BaseException] | None,
        exception: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """After a signal, wait for the jobs to end; then restore the earlier handlers.

        The steps must stay in this order.
        """
        if self.signal_number is not None:
            self._wait_for_threads()
        # End the thread of `_end_new_jobs`, which is needed until here.
        self._has_ended.set()

        # Restore the earlier handlers. From here on, Python writes nothing into the
        # pipe.
        signal.set_wakeup_fd(self._earlier_wakeup_fd)
        for number, handler in self._earlier_handlers.items():
            signal.signal(number, handler)

        # End the thread of `_forward_signals`, which reads the pipe until it gets this
        # byte. Only then close the pipe.
        os.write(self._writing_end, END_BYTE)
        self._thread.join()
        os.close(self._reading_end)
        os.close(self._writing_end)

    def _forward_signals(self) -> None:
        """Wait for signals, and send SIGINT to this process after SIGTERM or SIGHUP.

        Snakemake ends at SIGINT but not at the other two. The loop runs in a thread,
        which `__enter__` starts. It ends when `__exit__` writes `END_BYTE` into the
        pipe.
        """
        while True:
            # Each signal is one byte. `os.read` blocks until the next one.
            number = os.read(self._reading_end, 1)[0]
            if number == END_BYTE[0]:
                return
            # Forward only the first signal. After a second SIGINT, the program would
            # end immediately.
            if number in self._forwarded_signals and self.signal_number is None:
                self.signal_number = number
                os.kill(os.getpid(), signal.SIGINT)

    def _handle_interrupt(self, number: int, _frame: FrameType | None) -> None:
        """Handle SIGINT: end the jobs, and raise KeyboardInterrupt."""
        # Restore the default, so that a second Ctrl-C ends this program immediately.
        signal.signal(number, signal.SIG_DFL)
        if self.signal_number is None:
            self.signal_number = number
        self._end_jobs()
        # Continue to search for jobs, because a library may catch the exception, and
        # Snakemake may be about to start another job.
        threading.Thread(target=self._end_new_jobs, daemon=True).start()
        raise KeyboardInterrupt

    def _end_new_jobs(self) -> None:
        """Interrupt jobs that start after the signal, until the run has ended."""
        while not self._has_ended.wait(SEARCH_INTERVAL_S):
            self._end_jobs()

    def _wait_for_threads(self) -> None:
        """Wait for the threads of the run, while another thread ends the jobs they start.

        Snakemake runs each job in a thread and waits for these threads. If the
        exception is raised while Snakemake starts a thread, it does not know this
        thread and does not wait for it. Python itself would wait for the thread at the
        end of the program, when nothing interrupts its job any more.
        """
        # A thread that has not begun by the time limit will never begin, because the
        # exception was raised before the system had created it.
        limit = time.monotonic() + THREAD_START_LIMIT_S
        while any(
            thread.is_alive() or time.monotonic() < limit
            for thread in threading.enumerate()
            if thread not in self._earlier_threads and not thread.daemon
        ):
            time.sleep(0.05)

    def _end_jobs(self) -> None:
        """Send SIGINT to each running job, and again to one that does not end soon.

        Ctrl-C on a terminal reaches the jobs directly. A signal to this program does
        not.
        """
        # This library belongs to the optional dependencies `workflow`.
        import psutil

        now = time.monotonic()
        for job in psutil.Process().children(recursive=True):
            last_signal_s = self._interrupted_at.get(job)
            if last_signal_s is None or now - last_signal_s >= REPEAT_AFTER_S:
                self._interrupted_at[job] = now
                # The job may have ended in the meantime.
                with contextlib.suppress(psutil.NoSuchProcess):
                    job.send_signal(signal.SIGINT)
