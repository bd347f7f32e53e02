"""Time the compilation of each kernel that ``proxbench warm`` compiles.

    NUMBA_CACHE_DIR=$(mktemp -d) python tests/speed/kernel_costs.py

The time of a kernel excludes that of the kernels that it calls. Kernels in the cache do not count.
"""

import time
from collections import defaultdict

from numba.core import event
from proxbench.bench.cli.compilation.processes import compile_here
from proxbench.bench.cli.compilation.warm import parts

SHOWN = 10
"""Number of kernels that are printed."""


class KernelCosts(event.Listener):
    """Sum the wall time of compilations by kernel [s], without nested ones."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = defaultdict(float)
        self.signatures: dict[str, int] = defaultdict(int)
        self._begins: list[list[float]] = []

    def on_start(self, compilation: event.Event) -> None:
        """Remember the time."""
        self._begins.append([time.perf_counter(), 0.0])

    def on_end(self, compilation: event.Event) -> None:
        """Add the time since the start, without that of nested compilations."""
        begin, nested = self._begins.pop()
        seconds = time.perf_counter() - begin
        if self._begins:
            self._begins[-1][1] += seconds
        function = compilation.data["dispatcher"].py_func
        name = f"{function.__module__.removeprefix('proxbench.')}.{function.__name__}"
        self.seconds[name] += seconds - nested
        self.signatures[name] += 1


if __name__ == "__main__":
    costs = KernelCosts()
    event.register("numba:compile", costs)  # type: ignore[no-untyped-call]
    compile_here(parts())
    own = [name for name in costs.seconds if not name.startswith("numba.")]  # numba compiles some of NumPy's functions
    for name in sorted(own, key=costs.seconds.__getitem__, reverse=True)[:SHOWN]:
        print(f"{costs.seconds[name]:6.2f} s  {costs.signatures[name]:3d}  {name}")
