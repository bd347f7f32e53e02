"""Stored runs as pandas frames, whose columns are the fields of the records.

A field that is itself a record contributes the columns of its fields. Times have a column of their median, with the
name of the field, and columns of their quartiles. Lists have separate frames.
"""

import itertools
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Annotated, Any, NamedTuple, Self, get_args, get_origin

import msgspec
import numpy as np
import pandas as pd
from msgspec import Struct

from ...problems.contact.judge import NON_NUMERIC_FIELDS, Verdict
from ...problems.errors import suggestion
from ..errors import BenchError
from .bundles.bundle import open_run, output_folder
from .fields import Quartiles, Record
from .impulses import number_of
from .notes import notes_of
from .records import CaseRecord, Point, QuantityError, Round, RunRecord
from .store import case_file_name

JUDGED, LOCAL = "judged", "local"
"""Residuals that tables and charts can show: the judged one, or the local one of the verdict."""

RESIDUALS = (JUDGED, LOCAL)
"""Names of all kinds of residuals."""

CASE = ["problem", "solver"]
"""Columns that identify a case."""

POINT = [*CASE, "tolerance"]
"""Columns that identify a point."""

_IDENTITY = ("problem", "solver", "model")
"""Fields of a case that its points repeat."""


@dataclass(frozen=True)
class RunFrames:
    """One run.

    Attributes:
        folder: its folder, or its bundle.
        cases: one row per case: the family of the problem, the scalar fields of ``CaseRecord``, is_finished,
            and is_tried (whether the whole ladder was measured at least once, or the case failed).
        points: one row per ladder point: problem, family, solver, model, the fields of ``Point`` and ``Measured``
            (median times [s] with their quartiles, the numbers of the verdict), and notes.
        rounds: one row per round of a point: problem, solver, tolerance, and the fields of ``Round``.
        iterations: the convergence curves: problem, solver, iteration, residual.
        errors: one row per point and quantity of a trajectory: problem, solver, tolerance, quantity, error, and the
            ends of its error bar, low and high.
        info: plan, machine, plugins and sessions.
        damaged: one sentence for each case file that could not be read, or whose case is not planned.
        residual: kind of the residuals of the points, "judged" or "local"; those of the curves are judged.
    """

    folder: Path
    cases: pd.DataFrame
    points: pd.DataFrame
    rounds: pd.DataFrame
    iterations: pd.DataFrame
    errors: pd.DataFrame
    info: RunRecord
    damaged: list[str]
    residual: str = JUDGED

    @property
    def output_folder(self) -> Path:
        """The folder for its tables, charts and page; for a bundle, a folder with the name of the bundle beside it."""
        return output_folder(self.folder)

    @property
    def n_planned(self) -> int:
        """Number of planned cases."""
        return len(self.info.plan.problems) * len(self.info.plan.solvers)

    @property
    def n_finished(self) -> int:
        """Number of readable cases that are completely measured."""
        return int(self.cases["is_finished"].sum())

    @property
    def is_finished(self) -> bool:
        """Whether all planned cases are completely measured."""
        return self.n_finished >= self.n_planned

    @property
    def is_study(self) -> bool:
        """Whether the run is a study of simulations."""
        return bool(self.info.plan.trajectories)

    def only(self, problems: Collection[str]) -> Self:
        """Return the run restricted to some problems.

        Raises:
            BenchError: if the run does not have one of them.
        """
        plan = self.info.plan
        for name in problems:
            if name not in plan.problems:
                raise BenchError(f"the run has no problem {name!r}{suggestion(name, plan.problems)}")
        restricted_plan = msgspec.structs.replace(
            plan,
            problems=[name for name in plan.problems if name in problems],
            available=plan.n_available,
            trajectories=[trajectory for trajectory in plan.trajectories if trajectory.name in problems],
        )
        frames = {name: getattr(self, name) for name in ("cases", "points", "rounds", "iterations", "errors")}
        restricted_frames = {name: frame[frame["problem"].isin(problems)] for name, frame in frames.items()}
        return replace(self, info=msgspec.structs.replace(self.info, plan=restricted_plan), **restricted_frames)

    def judged_by(self, residual: str) -> Self:
        """Return the run with "judged" or "local" residuals of its points.

        Claims of solvers and outcomes of cases always refer to the judged residual.

        Raises:
            BenchError: if the name is unknown, or the run has no local residuals.
        """
        check_residual(residual)
        if residual == self.residual:
            return self
        judged = self.points.get("judged_residual", self.points["residual"])
        local = self.points["local_residual"].where(~np.isposinf(judged), np.inf)
        if self.is_study or (judged.notna() & local.isna()).any():
            raise BenchError(
                f"{self.folder} has no local residuals; show the judged ones, or measure its problems again."
            )
        values = local if residual == LOCAL else judged
        return replace(self, residual=residual, points=self.points.assign(residual=values, judged_residual=judged))


def check_residual(name: str) -> None:
    """Raise ``BenchError`` if there is no residual of that name."""
    if name not in RESIDUALS:
        raise BenchError(f"there is no residual {name!r}{suggestion(name, RESIDUALS)}")


def read_frames(path: Path, problem: str | None = None) -> RunFrames:
    """Read the folder or the bundle of a run, or the cases of one problem; list damaged and unplanned case files.

    Raises:
        BenchError: if the path is not a run, or its run.json or the bundle is damaged.
    """
    store = open_run(path)
    info = store.read_run()
    planned = itertools.product(info.plan.problems, info.plan.solvers)
    order = {pair: number for number, pair in enumerate(planned)}
    stored, damaged = store.read_cases(problem)
    cases = sorted((case for case in stored if _pair(case) in order), key=lambda case: order[_pair(case)])
    damaged += [
        f"{case_file_name(case)} contains a case that is not in the plan of the run; remove this file."
        for case in stored
        if _pair(case) not in order
    ]
    case_rows = _frame(CaseRecord, cases)
    case_rows["is_finished"] = pd.Series([case.is_finished(info.plan) for case in cases], dtype=bool)
    case_rows["is_tried"] = pd.Series([case.is_tried(info.plan) for case in cases], dtype=bool)
    points = points_frame(cases)
    for frame in (case_rows, points):
        frame.insert(1, "family", frame["problem"].map(info.plan.family).astype(str))
    errors = _parts(_identified(cases), QuantityError, lambda point: point.measured.errors if point.measured else [])
    return RunFrames(path, case_rows, points, rounds_frame(cases), _iterations(cases), errors, info, damaged)


def points_frame(cases: Sequence[CaseRecord]) -> pd.DataFrame:
    """Return the points of cases, as in ``RunFrames``."""
    identified = _identified(cases)
    identity = {name: [getattr(case, name) for case, _ in identified] for name in _IDENTITY}
    frame = pd.concat([pd.DataFrame(identity, dtype=str), _frame(Point, [point for _, point in identified])], axis=1)
    return frame.assign(notes=pd.Series([notes_of(case, point) for case, point in identified], dtype=str))


def rounds_frame(cases: Sequence[CaseRecord]) -> pd.DataFrame:
    """Return the rounds of the points of cases, as in ``RunFrames``."""
    return _parts(_identified(cases), Round, lambda point: point.rounds)


def _pair(case: CaseRecord) -> tuple[str, str]:
    return case.problem, case.solver


def _identified(cases: Sequence[CaseRecord]) -> list[tuple[CaseRecord, Point]]:
    """Return all points, each with its case."""
    return [(case, point) for case in cases for point in case.points]


class _Column(NamedTuple):
    """One column: its name, the path to its values in a record, their type, and the number that None stands for."""

    name: str
    path: tuple[str, ...]
    dtype: Any
    missing: float

    def value(self, record: Any) -> Any:
        """Return the value of a record; NaN if a record on the path is missing."""
        for name in self.path:
            if record is None:
                return np.nan
            record = record.get(name) if isinstance(record, dict) else getattr(record, name)
        if record is None:
            return self.missing
        return str(record) if isinstance(record, str) else record  # text of an enumeration


def _frame(kind: type[Record], records: Sequence[Record]) -> pd.DataFrame:
    """Return one row per record; of several fields with the same name, the first one has the column."""
    columns: dict[str, _Column] = {}
    for column in _columns(kind):
        columns.setdefault(column.name, column)
    return pd.DataFrame(
        {
            name: pd.Series([column.value(record) for record in records], dtype=column.dtype)
            for name, column in columns.items()
        }
    )


def _columns(kind: type[Struct], path: tuple[str, ...] = ()) -> Iterator[_Column]:
    """Yield the columns of a record, without lists."""
    for field in msgspec.structs.fields(kind):
        field_path = (*path, field.name)
        plain, missing = _plain(field.type)
        if plain is Quartiles:
            for part in msgspec.structs.fields(Quartiles):
                name = field.name if part.name == "median" else f"{field.name}_{part.name}"
                yield _Column(name, (*field_path, part.name), np.float64, np.nan)
        elif isinstance(plain, type) and issubclass(plain, Record):
            yield from _columns(plain, field_path)
        elif get_origin(plain) is dict:  # the verdict, whose numbers are those of the judge
            for number in fields(Verdict):
                if number.name not in NON_NUMERIC_FIELDS:
                    dtype = object if number.type is bool else np.float64
                    yield _Column(number.name, (*field_path, number.name), dtype, np.nan)
        elif get_origin(plain) is not list:
            is_inner = bool(path)
            dtypes = {int: np.float64 if is_inner else np.int64, float: np.float64, bool: object if is_inner else bool}
            yield _Column(field.name, field_path, dtypes.get(plain, str), missing)


def _plain(hint: Any) -> tuple[Any, float]:
    """Return the type of a field without constraints and None, and the number that None stands for."""
    missing = np.nan
    while get_origin(hint) is not None:
        if get_origin(hint) is Annotated:
            hint, *notes = get_args(hint)
            missing = next((note.extra["none"] for note in notes if note.extra), missing)
        elif type(None) in get_args(hint):
            hint = next(option for option in get_args(hint) if option is not type(None))
        else:
            break
    return hint, missing


def _parts(
    points: Sequence[tuple[CaseRecord, Point]], kind: type[Record], parts: Callable[[Point], Sequence[Record]]
) -> pd.DataFrame:
    """Return one row per record of a kind in the points; its first columns are problem, solver and tolerance."""
    rows = [(case, point, part) for case, point in points for part in parts(point)]
    identity = {name: [getattr(case, name) for case, _, _ in rows] for name in ("problem", "solver")}
    names = pd.DataFrame({**identity, "tolerance": [point.tolerance for _, point, _ in rows]})
    names = names.astype({"problem": str, "solver": str, "tolerance": np.float64})
    return pd.concat([names, _frame(kind, [part for _, _, part in rows])], axis=1)


def _iterations(cases: Sequence[CaseRecord]) -> pd.DataFrame:
    """Return the convergence curves, as in ``RunFrames``."""
    rows = [
        (case.problem, case.solver, iteration, number_of(residual))
        for case in cases
        for iteration, residual in zip(case.curve.iteration, case.curve.residual, strict=True)
    ]
    types = {"problem": str, "solver": str, "iteration": np.int64, "residual": np.float64}
    return pd.DataFrame(rows, columns=list(types)).astype(types)
