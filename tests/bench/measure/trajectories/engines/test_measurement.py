"""A run of an engine stays on one core."""

import os
import subprocess
import sys

import pytest


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="the system has no affinity")
def test_a_run_stays_on_one_core() -> None:
    code = "import os; from proxbench.bench.measure.trajectories.engines.measurement import stay_on_one_core as stay; "
    done = subprocess.run(
        [sys.executable, "-c", code + "stay(); print(len(os.sched_getaffinity(0)))"], capture_output=True, check=True
    )
    assert done.stdout.strip() == b"1"
