"""SIGTERM in a run of the workflow while its main thread holds Snakemake's lock."""

import signal
import threading
import time

import pytest

from repose.config.workflow_run import handle_sigterm_in_thread

PATIENCE_S = 60


@pytest.fixture
def lock():
    """A lock for which the handler of SIGTERM waits, as Snakemake's does."""
    lock = threading.Lock()
    earlier = signal.getsignal(signal.SIGTERM)
    yield lock
    signal.signal(signal.SIGTERM, earlier)


def test_sigterm_waits_for_a_lock_of_the_main_thread(lock):
    signals = []
    has_ended = threading.Event()

    def end(number, _frame):
        # In the main thread this would wait for itself.
        assert threading.current_thread() is not threading.main_thread()
        with lock:
            signals.append(number)
        if len(signals) == 2:
            has_ended.set()

    signal.signal(signal.SIGTERM, end)
    handle_sigterm_in_thread()
    with lock:
        signal.raise_signal(signal.SIGTERM)
        signal.raise_signal(signal.SIGTERM)
        time.sleep(0.1)
        assert signals == []
    assert has_ended.wait(PATIENCE_S)
    assert signals == [signal.SIGTERM, signal.SIGTERM]


@pytest.mark.parametrize("handler", [signal.SIG_DFL, signal.SIG_IGN])
def test_sigterm_without_a_handler_stays_so(lock, handler):
    signal.signal(signal.SIGTERM, handler)
    handle_sigterm_in_thread()
    assert signal.getsignal(signal.SIGTERM) == handler


def test_a_thread_leaves_the_handler_alone(lock):
    handler = signal.getsignal(signal.SIGTERM)
    thread = threading.Thread(target=handle_sigterm_in_thread)
    thread.start()
    thread.join()
    assert signal.getsignal(signal.SIGTERM) == handler
