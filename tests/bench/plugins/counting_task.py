"""A task for processes of tests."""

import os
import subprocess
from dataclasses import dataclass
from typing import Any


@dataclass
class Counting:
    """Counts how often it has answered."""

    count: int = 0

    def answer(self, request: str, arguments: tuple[Any, ...]) -> tuple[dict[str, Any], bytes]:
        if request == "die":
            os._exit(9)
        if request == "leave a process":
            subprocess.Popen(["sleep", "60"], start_new_session=True)
        self.count += 1
        return {"count": self.count}, b""
