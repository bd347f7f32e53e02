"""Plugins as single Python files, named on the command line instead of being installed.

A file lists what it offers: ``SOLVERS = [MySolver]``, ``PROBLEMS = {"my-problem": my_problem}`` and
``SCENES = {"my_scene": my_scene}``. The file is read once, and every process runs the content that was read. Editing
the file therefore does not change a run.
"""

import hashlib
import re
import sys
import traceback
from collections.abc import Callable, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType
from typing import Any, Literal, get_args

from ...errors import PluginError, first_line

Kind = Literal["solver", "problem", "scene"]

_EXAMPLES = {"problem": '{"my-problem": my_problem}', "scene": '{"my_scene": my_scene}'}


@dataclass(frozen=True)
class PluginFile:
    """One plugin file as it was read.

    Attributes:
        path: absolute path of the file.
        content: bytes of the file.
    """

    path: Path
    content: bytes

    @staticmethod
    def read(path: Path | str) -> "PluginFile":
        """Read a plugin file without running it.

        Raises:
            PluginError: if the file does not exist, cannot be read, or contains binary data.
        """
        absolute = Path(path).expanduser().resolve()
        try:
            content = absolute.read_bytes()
        except FileNotFoundError:
            raise PluginError(f"there is no plugin file {path}; name a Python file.") from None
        except OSError as error:
            raise PluginError(f"cannot read plugin file {path}: {error.strerror}; name a Python file.") from None
        if b"\0" in content:
            raise PluginError(f"{path} is not a plugin file: it contains binary data; name a Python file.")
        return PluginFile(absolute, content)

    @property
    def sha256(self) -> str:
        """SHA-256 of the content."""
        return hashlib.sha256(self.content).hexdigest()

    @property
    def source(self) -> str:
        """Name of the file in messages."""
        return f"plugin file {self.path}"

    @property
    def module_name(self) -> str:
        """Name under which the file is imported, different for each path."""
        stem = re.sub(r"\W", "_", self.path.stem)
        return f"proxbench_plugin_{stem}_{hashlib.sha256(str(self.path).encode()).hexdigest()[:8]}"

    def module(self) -> ModuleType:
        """Return the module of the file, which runs at the first call after ``make_importable``.

        Raises:
            PluginError: if the module fails to import; the message gives the line.
        """
        try:
            with redirect_stdout(sys.stderr):
                return import_module(self.module_name)
        except MemoryError:
            raise
        except (Exception, SystemExit) as error:
            raise PluginError(
                f"{self.source} fails to import{_line_phrase(error, self.path)}: {first_line(error)}."
            ) from None

    def offered(self, kind: Kind) -> dict[str, Callable[..., Any]]:
        """Return the classes or functions of one kind that the file offers, by name.

        Raises:
            PluginError: if SOLVERS is not a list of classes, two of them have the same name, or PROBLEMS or SCENES is
                not a dictionary of functions.
        """
        return self._solvers() if kind == "solver" else self._functions(f"{kind.upper()}S", _EXAMPLES[kind])

    def _solvers(self) -> dict[str, Callable[..., Any]]:
        offered = getattr(self.module(), "SOLVERS", [])
        if not isinstance(offered, list | tuple) or not all(callable(entry) for entry in offered):
            raise PluginError(f"{self.source}: SOLVERS must be a list of solver classes, SOLVERS = [MySolver].")
        names = [getattr(entry, "__name__", repr(entry)) for entry in offered]
        duplicate = next((name for name in names if names.count(name) > 1), None)
        if duplicate is not None:
            raise PluginError(
                f"{self.source}: SOLVERS offers the name {duplicate!r} twice; rename or remove one of them."
            )
        return dict(zip(names, offered, strict=True))

    def _functions(self, variable: str, example: str) -> dict[str, Callable[..., Any]]:
        offered = getattr(self.module(), variable, {})
        if not isinstance(offered, dict) or not all(
            isinstance(name, str) and callable(function) for name, function in offered.items()
        ):
            raise PluginError(f"{self.source}: {variable} must map names to functions, {variable} = {example}.")
        return dict(offered)

    def check_offers(self) -> None:
        """Raise ``PluginError`` if the file offers nothing, or if an offer is invalid; see ``offered``."""
        offers = [self.offered(kind) for kind in get_args(Kind)]  # every kind, so that each is checked
        if any(offers):
            return
        candidates = [
            name
            for name, value in vars(self.module()).items()
            if isinstance(value, type) and value.__module__ == self.module_name and hasattr(value, "prepare")
        ]
        raise PluginError(
            f"{self.source} offers nothing; list its solver classes, SOLVERS = [{', '.join(candidates) or 'MySolver'}]"
            f", its problems, PROBLEMS = {_EXAMPLES['problem']}, or its scenes, SCENES = {_EXAMPLES['scene']}."
        )


class _Importer(MetaPathFinder, Loader):
    """Import plugin files by module name, also when pickle imports one in another process."""

    def find_spec(self, name: str, path: Sequence[str] | None, target: ModuleType | None = None) -> ModuleSpec | None:
        return ModuleSpec(name, self, origin=str(_IMPORTABLE[name].path)) if name in _IMPORTABLE else None

    def exec_module(self, module: ModuleType) -> None:
        file = _IMPORTABLE[module.__name__]
        module.__file__ = str(file.path)
        exec(compile(file.content, str(file.path), "exec"), module.__dict__)


_IMPORTER = _Importer()

_IMPORTABLE: dict[str, PluginFile] = {}
"""Files that can be imported, by module name."""


def make_importable(file: PluginFile) -> None:
    """Make the module of ``file`` importable in this process, also for pickles; it runs at its first import."""
    sys.modules.pop(file.module_name, None)
    _IMPORTABLE[file.module_name] = file
    if _IMPORTER not in sys.meta_path:
        sys.meta_path.append(_IMPORTER)


def _line_phrase(error: BaseException, path: Path) -> str:
    """Return ``" on line 12"`` for the deepest line of ``path`` that an exception passed through, or an empty text."""
    if isinstance(error, SyntaxError) and error.filename == str(path):
        return f" on line {error.lineno}"
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path)]
    return f" on line {lines[-1]}" if lines else ""
