"""A task for processes of tests."""

import os
import resource
import subprocess
import sys
import time
from dataclasses import dataclass, field
from typing import Any

from proxbench.problems.compilation.cached_kernels import load_cached_kernels
from proxbench.solvers.registry import BUILT_IN


@dataclass
class Counting:
    """Counts its answers."""

    count: int = 0
    left: list["subprocess.Popen[bytes]"] = field(default_factory=list)

    def answer(self, request: str, arguments: tuple[Any, ...]) -> tuple[dict[str, Any], bytes]:
        if request == "die":
            os._exit(9)
        if request == "leave a process":
            self.left.append(subprocess.Popen(["sleep", "60"], start_new_session=True))
        if request == "end what is left":
            for process in self.left:
                process.terminate()
                process.wait(30.0)
        if request == "fork and return in both":
            return {"fork has ended": self._fork()}, b""
        if request == "limits":
            files, core = (list(resource.getrlimit(what)) for what in (resource.RLIMIT_FSIZE, resource.RLIMIT_CORE))
            return {"file": files, "core": core}, b""
        if request == "load kernels":
            return {"kernels": load_cached_kernels()}, b""
        if request == "solvers":
            return {"loaded": [name for name, module in BUILT_IN.items() if _is_loaded(name, module)]}, b""
        if request == "sleep":
            time.sleep(60.0)
        if request == "work":
            end = time.process_time() + 0.02
            while time.process_time() < end:
                pass
        self.count += 1
        return {"count": self.count}, b""

    def _fork(self) -> bool:
        """Fork; return False in the fork, and in this process whether the fork ends within ten seconds."""
        fork = os.fork()
        if fork == 0:
            return False
        for _ in range(1000):
            if os.waitpid(fork, os.WNOHANG)[0]:
                return True
            time.sleep(0.01)
        return False


def _is_loaded(solver: str, module: str) -> bool:
    """Return whether this process has imported the class of a solver."""
    return hasattr(sys.modules.get(f"proxbench.solvers.{module}"), solver)
