"""Import of MuJoCo on first use, in a tested version."""

import importlib
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any

from ..errors import ProblemError

SUPPORTED_VERSION = "4.0"
"""Supported version of MuJoCo, with any patch release."""

INSTALL = 'pip install ".[mujoco]" in a clone of proxbench'
"""Instruction that installs MuJoCo."""


def mujoco() -> Any:
    """Import MuJoCo on first use.

    Raises:
        ProblemError: if MuJoCo is not installed, or its version is not supported.
    """
    if find_spec("mujoco") is None:
        raise ProblemError(f"capturing needs MuJoCo, which is not installed; run {INSTALL}.")
    module = importlib.import_module("mujoco")
    version = str(module.__version__)
    if not f"{version}.".startswith(f"{SUPPORTED_VERSION}."):
        raise ProblemError(f"MuJoCo {version} is not supported; versions {SUPPORTED_VERSION}.x are; run {INSTALL}.")
    return module


@contextmanager
def without_log() -> Iterator[None]:
    """Keep MuJoCo from writing its warnings to MUJOCO_LOG.TXT in the current folder."""
    module = mujoco()
    handler = module.get_mju_user_warning()
    module.set_mju_user_warning(lambda message: None)
    try:
        yield
    finally:
        module.set_mju_user_warning(handler)
