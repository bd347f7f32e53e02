"""Base class of shared libraries and executables: name, model and supported problems from their description."""

import os
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

import numpy as np

from ...problems.contact.model import Model
from ...problems.contact.problem import ContactProblem
from ...problems.contact.solver import Solution, SolverError, Status
from ...problems.errors import ProblemError
from ..iteration.cores import usable_cores
from ..iteration.method import Method, unsupported_laws
from .structures import (
    BLOCKS,
    DENSE,
    FACTORS,
    INTERFACE,
    IS_RANDOMISED,
    LAWS,
    MODELS,
    SHOWS_ITERATES,
    SPARSE,
    STATUSES,
)

MAX_COUNT = 2**62
"""Largest iteration limit that a solver receives; larger limits are reduced to it."""

MAX_NAME_LENGTH = 80
"""Number of characters to which a name or a version is truncated."""


class BrokenInterfaceError(SolverError):
    """A solver in another language violated the rules of the interface during a solve."""


@dataclass(frozen=True)
class SolverFacts:
    """The checked description of a solver.

    Attributes:
        name, version: name and version that its author gave it.
        model: the model that it solves.
        forms: arrays that it requests, bits of ``pb_form``.
        laws: laws that it supports, bits of ``pb_laws``.
        flags: bits of ``pb_flags``.
    """

    name: str
    version: str
    model: Model
    forms: int
    laws: int
    flags: int

    @staticmethod
    def checked(
        source: str, name: str, version: str, model: int, sides: int, *, masks: tuple[int, int, int]
    ) -> "SolverFacts":
        """Return the facts of ``source``; ``masks`` are the forms, laws and flags.

        Raises:
            SolverError: if the model does not exist.
        """
        if not 0 <= model < len(MODELS):
            raise SolverError(f"{source} describes model {model}; return one of pb_model.")
        try:
            kind = Model.pyramid(sides) if MODELS[model] == "pyramid" else Model.from_text(MODELS[model])
        except ProblemError as error:
            raise SolverError(f"{source} describes an invalid model: {error}") from None
        return SolverFacts(name[:MAX_NAME_LENGTH], version[:MAX_NAME_LENGTH], kind, *masks)


def check_interface(source: str, version: int) -> None:
    """Raise ``SolverError`` unless ``source`` has the version ``INTERFACE`` of the interface."""
    if version != INTERFACE:
        raise SolverError(
            f"{source} has version {version} of the interface, but this Proxbench needs version {INTERFACE}; "
            "build it again with the current proxbench.h."
        )


@dataclass(frozen=True)
class NativeSolver(ABC):
    """A solver in another language, which is loaded or started when the object is created.

    Attributes:
        path: its file, absolute or relative to the working folder.
        options: text for the solver.
        facts: its description of itself.

    Raises:
        SolverError: if the file is missing, or is not a solver with this version of the interface.
    """

    path: str = ""
    options: str = ""
    facts: SolverFacts = field(init=False, repr=False, compare=False)

    kind: ClassVar[str]
    """Name of the kind of file in messages."""

    example: ClassVar[str]
    """Example of a solver of this kind in messages."""

    def __post_init__(self) -> None:
        class_name = type(self).__name__
        if not (isinstance(self.path, str) and self.path and isinstance(self.options, str)):
            raise SolverError(f"{class_name} needs the path of a file, and options as text; write {self.example}.")
        if not self.file.is_file():
            raise SolverError(f"there is no {self.kind} {self.path}; build it, or correct its path.")
        object.__setattr__(self, "facts", self._describe())

    @abstractmethod
    def _describe(self) -> SolverFacts:
        """Load or start the solver, and return its description."""

    @property
    def file(self) -> Path:
        """The file, absolute."""
        return Path(self.path).expanduser().absolute()

    @property
    def source(self) -> str:
        """Kind and path of the file, with name and version of the solver, for stored runs."""
        about = f"{self.facts.name} {self.facts.version}".strip()
        return f"{self.kind} {self.file}{about and f' ({about})'}"

    @property
    def name(self) -> str:
        """``Shared('./libmine.so')``, with the options if there are any."""
        options = f", options={self.options!r}" if self.options else ""
        return f"{type(self).__name__}({self.path!r}{options})"

    @property
    def model(self) -> Model:
        """The model that it solves."""
        return self.facts.model

    @property
    def has_iterates(self) -> bool:
        """Whether it passes its iterates to the observer."""
        return bool(self.facts.flags & SHOWS_ITERATES)

    @property
    def is_randomised(self) -> bool:
        """Whether it declares that its results differ between repeats."""
        return bool(self.facts.flags & IS_RANDOMISED)

    def supports(self, problem: ContactProblem) -> str | None:
        """Return why the solver cannot solve ``problem``, or None."""
        reason = unsupported_laws(problem, Method.law_kinds)
        if reason:
            return reason
        missing = laws_of(problem) & ~self.facts.laws
        if missing:
            return f"{self.facts.name} does not support {LAWS[(missing & -missing).bit_length() - 1]}"
        if problem.factors is None and self.facts.forms & FACTORS and not self.facts.forms & (DENSE | SPARSE | BLOCKS):
            return f"the problem holds G only, and {self.facts.name} needs its factors W and M⁻¹"
        return None

    def check_supports(self, problem: ContactProblem) -> None:
        """Raise ``SolverError`` if the solver cannot solve ``problem``."""
        reason = self.supports(problem)
        if reason is not None:
            raise SolverError(f"{self.name} cannot solve {problem.name!r}: {reason}.")

    def __reduce__(self) -> tuple[type, tuple[str, str]]:
        return type(self), (self.path, self.options)


def laws_of(problem: ContactProblem) -> int:
    """Return the laws that a solver of ``problem`` must support, as bits of ``pb_laws``."""
    laws = problem.laws
    slides = laws.is_friction & ~laws.is_rolling
    needs = (
        laws.is_unilateral.any(),
        laws.is_bilateral.any(),
        (slides & (laws.row_count == 1)).any(),
        (slides & (laws.row_count == 2)).any(),
        laws.is_rolling.any(),
        laws.fixed_bound.any() or not problem.layout.bounds_are_own,
        problem.allow_asymmetric and abs(problem.delassus() - problem.delassus().T).sum() > 0.0,
    )
    return sum(1 << bit for bit, is_needed in enumerate(needs) if is_needed)


def status_of(source: str, code: int) -> Status:
    """Return the status of a code.

    Raises:
        BrokenInterfaceError: if the code is not valid.
    """
    if not 0 <= code < len(STATUSES):
        raise BrokenInterfaceError(f"{source} returned status {code}; return one of pb_status.")
    return STATUSES[code]


def granted_threads() -> int:
    """Return the number of threads that a solver may use.

    This is the value of OMP_NUM_THREADS, which is 1 in all measurements. If it is not set, this is the number of cores
    that this process may use.
    """
    value = os.environ.get("OMP_NUM_THREADS", "")
    return int(value) if value.isdecimal() and int(value) else usable_cores()


def refused_solution(n_rows: int, status: Status, message: str) -> Solution:
    """Return the solution of a problem that a solver refused to prepare."""
    return Solution(np.zeros(n_rows), status, 0, message or "it refused to prepare the problem")
