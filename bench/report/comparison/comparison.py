"""The comparison of two runs: frames of differences, a verdict in one sentence, and the conditions that fail."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from html import escape

import pandas as pd

from ...errors import BenchError
from ...store.fields import accuracy_tag
from ...store.frames import CASE, POINT, RunFrames
from ...store.outcome import Outcome
from ..layout.text import titled_names
from .pairing import pair
from .solved_changes import SOLVED, UNSOLVED, find_solved_changes
from .times import Times, compare_times

SLOWDOWN = 0.1
"""Relative slowdown or speed-up above which a verdict names a solver."""

MAX_NAMED = 3
"""Largest number of names of each kind in a verdict."""


@dataclass(frozen=True)
class Comparison:
    """The differences between two runs.

    Attributes:
        before, after: the runs, restricted to common solvers and problems.
        notes: sentences about omitted parts and other differences.
        incomparable_reason: why times are not comparable; empty if they are. If they are not, the frames of times are
            empty.
        points: one row per solver, problem and accuracy that both runs reach: times before and after [s], their ratio
            as measured, and the ends of its 95 % interval, low and high.
        cases: one row per solver and problem: geometric means of times over its accuracies [s], their ratio over the
            scale, and the ends of simultaneous intervals: all true ratios exceed their lower ends with probability
            95 %.
        solvers: the same for each solver over its problems, with their number and individual intervals.
        scale: factor that divides the times of the second run in the ratios of cases and solvers. It is common to all
            solvers and attributed to the machine.
        changes: one row per solver, problem and accuracy that only one run reaches: change is "solved", "unsolved", or
            "undecided", see ``find_solved_changes``; reason describes how the solve ended in the other run.
        slowdown: relative slowdown above which the verdict names a solver.
    """

    before: RunFrames
    after: RunFrames
    notes: tuple[str, ...]
    incomparable_reason: str
    points: pd.DataFrame
    cases: pd.DataFrame
    solvers: pd.DataFrame
    scale: float
    changes: pd.DataFrame
    slowdown: float = SLOWDOWN

    def __repr__(self) -> str:
        return f"<Comparison of {self.before.info.run_id} and {self.after.info.run_id}: {self.verdict}>"

    def _repr_html_(self) -> str:
        headings = {"solver": "solver", "problems": "problems", "ratio": "time ratio", "low": "low", "high": "high"}
        table = self.solvers[list(headings)].rename(columns=headings)
        return (
            f"<h4>{escape(self.before.info.run_id)} and {escape(self.after.info.run_id)}</h4>"
            f"<p>{escape(self.verdict)}</p>"
            + (table.to_html(index=False, border=0, escape=True, float_format="{:.3g}".format) if len(table) else "")
        )

    def slower(self, slowdown: float | None = None) -> list[str]:
        """Return solvers, and cases of other solvers, that are significantly slower by more than ``slowdown``."""
        bound = 1.0 + (self.slowdown if slowdown is None else slowdown)
        return self._texts_with_ratios(self.solvers[self.solvers["low"] > bound], self.cases[self.cases["low"] > bound])

    def faster(self) -> list[str]:
        """Return solvers, and cases of other solvers, that were significantly slower before, by over ``slowdown``."""
        bound = 1.0 / (1.0 + self.slowdown)
        return self._texts_with_ratios(
            self.solvers[self.solvers["high"] < bound], self.cases[self.cases["high"] < bound]
        )

    def changed(self, change: str) -> pd.DataFrame:
        """Return the rows of ``changes`` of one kind."""
        return self.changes[self.changes["change"] == change]

    @cached_property
    def verdict(self) -> str:
        """The differences in one sentence."""
        parts = [
            titled_names("slower", self.slower(), MAX_NAMED),
            titled_names("no longer solved", _points_in_words(self.changed(UNSOLVED)), MAX_NAMED),
            titled_names("faster", self.faster(), MAX_NAMED),
            titled_names("newly solved", _points_in_words(self.changed(SOLVED)), MAX_NAMED),
        ]
        changes = "; ".join(filter(None, parts))
        solved = changes or "both runs solve the same points"
        if self.incomparable_reason:
            return f"cannot tell which solvers are slower or faster: {self.incomparable_reason}; {solved}"
        if not self.has_intervals:
            return f"times are undecided, {self._undecided_reason}; {solved}"
        return changes or f"no solver is slower or faster by more than {100 * self.slowdown:g} %; {solved}"

    @property
    def has_intervals(self) -> bool:
        """Whether times have intervals."""
        return bool((self.cases["low"] > 0.0).any())

    @property
    def _undecided_reason(self) -> str:
        """Why no time has an interval."""
        if not self.cases.empty:
            return "each run has one pass"
        reached = (frames.points[frames.points["outcome"] == Outcome.SOLVED] for frames in (self.before, self.after))
        common = set.intersection(*(set(zip(*(points[key] for key in POINT), strict=True)) for points in reached))
        return "all common times are excluded" if common else "no accuracy is reached by both runs"

    def failures(self, fail_on: Sequence[str] | str) -> list[str]:
        """Return a sentence for each condition that is met or cannot be decided.

        Args:
            fail_on: one or several conditions, ``"time>10%"`` or ``"solved<"``.

        Raises:
            BenchError: if a condition is invalid.
        """
        sentences = []
        for condition, slowdown in read_conditions(fail_on).items():
            names = _points_in_words(self.changed(UNSOLVED)) if slowdown is None else self.slower(slowdown)
            if slowdown is not None and (self.incomparable_reason or not self.has_intervals):
                sentences.append(f"{condition} cannot be decided: {self.incomparable_reason or self._undecided_reason}")
            elif names:
                sentences.append(titled_names(condition, names, MAX_NAMED))
        return sentences

    def _texts_with_ratios(self, solvers: pd.DataFrame, cases: pd.DataFrame) -> list[str]:
        """Return solvers, and cases of other solvers, as text with their ratios."""
        others = cases[~cases["solver"].isin(solvers["solver"])]
        return [f"{row.solver} ({row.ratio:.2f} times)" for row in solvers.itertuples()] + [
            f"{row.solver} on {row.problem} ({row.ratio:.2f} times)" for row in others.itertuples()
        ]


def read_conditions(texts: Sequence[str] | str) -> dict[str, float | None]:
    """Return each condition with the largest relative slowdown that it allows; None for ``"solved<"``.

    Raises:
        BenchError: if a condition is invalid.
    """
    conditions: dict[str, float | None] = {}
    for text in [texts] if isinstance(texts, str) else texts:
        plain = re.sub(r"\s", "", text)
        match = re.fullmatch(r"time>(\d+(?:\.\d+)?)%", plain)
        if not match and plain != "solved<":
            raise BenchError(
                f"`fail_on` {text!r} is not a condition; use 'time>10%' (a solver is more than 10 % slower) or "
                "'solved<' (an accuracy is no longer reached)."
            )
        conditions[plain] = float(match[1]) / 100.0 if match else None
    return conditions


def compare_runs(before: RunFrames, after: RunFrames, slowdown: float = SLOWDOWN) -> Comparison:
    """Compare two runs; see ``proxbench.bench.compare``."""
    pairing = pair(before, after)
    times = compare_times(pairing)
    if pairing.incomparable_reason:
        times = Times(times.points.iloc[:0], times.cases.iloc[:0], times.solvers.iloc[:0], scale=1.0)
    return Comparison(
        pairing.before,
        pairing.after,
        pairing.notes,
        pairing.incomparable_reason,
        *times,
        find_solved_changes(pairing),
        slowdown,
    )


def _points_in_words(changes: pd.DataFrame) -> list[str]:
    """Return changes as text, with the coarsest accuracy of each solver and problem."""
    coarsest = changes.sort_values("accuracy", ascending=False, kind="stable").drop_duplicates(CASE)
    rows = zip(coarsest["solver"], coarsest["problem"], coarsest["accuracy"].astype(float).tolist(), strict=True)
    return [f"{solver} on {problem} to {accuracy_tag(accuracy)}" for solver, problem, accuracy in rows]
