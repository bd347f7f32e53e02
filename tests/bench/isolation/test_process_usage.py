"""Counts of context switches and waiting times are differences of the counts of the system."""

import time

from proxbench.bench.isolation.process_usage import ContextSwitches


def test_differences_are_taken_of_each_count() -> None:
    later, earlier = ContextSwitches(11, 7, 0.5), ContextSwitches(4, 5, 0.125)
    assert later.since(earlier) == ContextSwitches(7, 2, 0.375)


def test_an_unknown_waiting_time_stays_unknown() -> None:
    known, unknown = ContextSwitches(4, 5, 0.125), ContextSwitches(2, 3, None)
    assert known.since(unknown).waited is None
    assert unknown.since(known).waited is None


def test_a_process_that_sleeps_gives_up_the_processor_each_time() -> None:
    before = ContextSwitches.now()
    for _ in range(5):
        time.sleep(1e-4)
    switches = ContextSwitches.now().since(before)
    assert switches.voluntary >= 5
    assert switches.involuntary >= 0
    assert switches.waited is None or switches.waited >= 0.0
