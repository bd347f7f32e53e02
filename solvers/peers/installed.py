"""Check that the library of an external solver is installed, without importing it."""

from importlib import metadata
from importlib.util import find_spec

from ...problems.contact.solver import SolverError


def check_installed(solver: str, library: str, extra: str, tested_version: str = "") -> None:
    """Raise ``SolverError`` unless a library is installed in a tested version.

    Args:
        solver: the solver that needs it.
        library: its module, and its distribution if ``tested_version`` is given.
        extra: the extra of Proxbench that installs it.
        tested_version: prefix of the tested versions; if empty, any version is accepted.
    """
    remedy = f'run pip install ".[{extra}]" in a clone of proxbench'
    if find_spec(library) is None:
        raise SolverError(f"{solver} needs {library}, which is not installed; {remedy}")
    if tested_version and not (version := metadata.version(library)).startswith(f"{tested_version}."):
        raise SolverError(f"{solver} does not support {library} {version}, only {tested_version}.x; {remedy}")
