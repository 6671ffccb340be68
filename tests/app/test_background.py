"""Background work: its result, its errors, and that cancelling stops it."""

import threading

import pytest

from app.background import BackgroundTask
from hierarchy.model import Cancelled

SECONDS = 10.0


class Waker:
    """Counts how often it was called and lets one wait for the end of a task."""

    def __init__(self):
        self.calls = 0

    def __call__(self):
        self.calls += 1


def test_result_is_handed_over():
    waker = Waker()
    task = BackgroundTask(lambda progress: progress("Half", 0.5) or 42, waker)
    assert task.result() == 42
    assert task.finished
    assert task.progress == ("Half", 0.5)
    # At the start, at the report and at the end.
    assert waker.calls == 3


def test_finished_is_true_at_the_last_wake_up():
    """The loop sleeps until it is woken: a task that ends after its last wake-up would never be taken."""
    seen = []
    started = threading.Event()

    def wake():
        started.wait(SECONDS)
        seen.append(task.finished)

    task = BackgroundTask(lambda progress: None, wake)
    started.set()
    task.wait(SECONDS)
    task._thread.join(SECONDS)
    assert seen[-1]


def test_work_runs_on_another_thread():
    task = BackgroundTask(lambda progress: threading.get_ident(), Waker())
    assert task.result() != threading.get_ident()


@pytest.mark.parametrize("error", [ValueError("broken"), KeyboardInterrupt(), BaseException("panic")])
def test_error_is_raised_where_the_result_is_taken(error):
    def work(progress):
        raise error

    task = BackgroundTask(work, Waker())
    with pytest.raises(type(error)) as caught:
        task.result()
    assert caught.value is error


def test_cancel_stops_at_the_next_report():
    reported, go_on, after = threading.Event(), threading.Event(), []

    def work(progress):
        reported.set()
        go_on.wait(SECONDS)
        progress("Next", 0.5)
        after.append("ran on")

    task = BackgroundTask(work, Waker())
    assert reported.wait(SECONDS)
    task.cancel()
    go_on.set()
    with pytest.raises(Cancelled):
        task.result()
    assert after == []


def test_result_of_cancelled_work_is_not_taken():
    """Work that ends between the click on Cancel and its next report has been cancelled all the same."""
    reported, go_on = threading.Event(), threading.Event()
    task = BackgroundTask(lambda progress: reported.set() or go_on.wait(SECONDS), Waker())
    assert reported.wait(SECONDS)
    task.cancel()
    go_on.set()
    with pytest.raises(Cancelled):
        task.result()


def test_next_task_waits_for_the_one_before():
    order, go_on = [], threading.Event()
    first = BackgroundTask(lambda progress: go_on.wait(SECONDS) and order.append("first"), Waker())
    second = BackgroundTask(lambda progress: order.append("second"), Waker(), after=first)
    go_on.set()
    second.result()
    assert order == ["first", "second"]


def test_progress_stays_between_0_and_1():
    task = BackgroundTask(lambda progress: progress("Over", 1.5), Waker())
    task.result()
    assert task.progress == ("Over", 1.0)
