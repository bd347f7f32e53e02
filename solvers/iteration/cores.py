"""The cores that this process may use."""

import os


def usable_cores() -> int:
    """Return the number of cores that this process may use, which ``taskset`` and containers restrict."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def thread_requirement(cores: int) -> str:
    """Return the valid numbers of threads, as a text for messages."""
    if cores == 1:
        return "1, because this process may use only one core"
    return f"a whole number from 1 to {cores}, the cores that this process may use"
