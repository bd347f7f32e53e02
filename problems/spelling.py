"""How messages spell options: written once, read as the command line has them or as Python does.

A message that names an option holds both spellings between marks, characters that Unicode leaves to private use.
``str()`` of an error gives that of Python; the command line prints its own.
"""

import re

_BEGIN, _BETWEEN, _END = "\ue000", "\ue001", "\ue002"
_SPELT = re.compile(f"{_BEGIN}([^{_BEGIN}{_END}]*?){_BETWEEN}([^{_BEGIN}{_END}]*?){_END}")


def either(command_line: str, python: str) -> str:
    """Return text that reads differently on the command line and in Python."""
    return f"{_BEGIN}{command_line}{_BETWEEN}{python}{_END}"


def option(name: str) -> str:
    """Return an option by its name in Python: ``"run_id"`` reads ``--run-id`` on the command line, else ``run_id=``."""
    return either(f"--{name.replace('_', '-')}", f"{name}=")


def switch(name: str) -> str:
    """Return an option that is switched on: ``"force"`` reads ``--force`` on the command line, else ``force=True``."""
    return either(f"--{name.replace('_', '-')}", f"{name}=True")


def for_command_line(text: str) -> str:
    """Return a message as users of the command line read it."""
    return _SPELT.sub(lambda found: found.group(1), text)


def for_python(text: str) -> str:
    """Return a message as callers in Python read it."""
    return _SPELT.sub(lambda found: found.group(2), text)
