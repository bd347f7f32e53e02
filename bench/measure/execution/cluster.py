"""Clusters of dask.distributed as executors."""

from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import ExitStack, contextmanager
from typing import Any

from ...errors import BenchError

LOCAL = "local"
"""Address of a cluster on this machine, with one worker per core."""

CONNECT_SECONDS = 10.0
"""Time limit for the answer of a scheduler, and for the connection of its first worker [s]."""


@contextmanager
def dask_executor(address: str) -> Iterator[Executor]:
    """Yield an executor on a cluster; a cluster on this machine is closed with the executor.

    Args:
        address: address of its scheduler, "tcp://host:8786", or ``LOCAL``.

    Raises:
        BenchError: if dask is not installed, no scheduler answers at the address, or it has no worker.
    """
    try:
        import distributed
    except ImportError:
        raise BenchError('dask is not installed; run pip install ".[dask]" in a clone of proxbench') from None
    dask: Any = distributed  # classes of dask have no types
    with ExitStack() as stack:
        try:
            target: Any = address
            if address == LOCAL:
                target = stack.enter_context(dask.LocalCluster(threads_per_worker=1, dashboard_address=None))
            client = stack.enter_context(dask.Client(target, timeout=CONNECT_SECONDS, set_as_default=False))
            client.wait_for_workers(1, timeout=CONNECT_SECONDS)
        except (OSError, TimeoutError, ValueError) as error:
            reason = type(error).__name__
            raise BenchError(
                f"there is no dask cluster with workers at {address} ({reason}); start it, or use another address."
            ) from None
        yield client.get_executor(pure=False)  # gives a repeated task a different key
