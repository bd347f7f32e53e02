"""What was measured, as suggestions need it: times of solvers, and features of the problems.

The package has such a table of its own, ``measured.parquet``: one row a problem and solver, with the family, the
features and the time to each accuracy.
"""

from contextlib import suppress
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ....problems.catalog.catalog import load
from ....problems.contact.problem import ContactProblem
from ....problems.errors import ProxbenchError
from ...errors import BenchError
from ...store.condition import refuse_unfit
from ...store.frames import RunFrames
from ...store.store import Store
from ..accuracy import accuracies, attempts
from .features import FEATURES, features

SHIPPED = "measured.parquet"
"""File of the package beside this one."""


@dataclass(frozen=True)
class Measured:
    """Times of solvers on problems.

    Attributes:
        source: where they are from, in words.
        problems: one row a problem, by its name: family, and the features.
        times: columns problem, solver, accuracy, seconds: the time to a judged residual, NaN if it was not reached. A
            solver that does not support a problem has no row.
    """

    source: str
    problems: pd.DataFrame
    times: pd.DataFrame

    def at(self, accuracy: float) -> tuple[pd.DataFrame, float]:
        """Return seconds, problems down and solvers across, to the coarsest accuracy that is no coarser, and that one.

        Raises:
            BenchError: if all are coarser.
        """
        fine = [one for one in self.times["accuracy"].unique() if one <= accuracy * (1.0 + 1e-9)]
        if not fine:
            raise BenchError(
                f"{self.source} has no accuracy as fine as {accuracy:g}; choose {self.times['accuracy'].min():g} or a "
                "coarser one, or measure one that has."
            )
        own = self.times[self.times["accuracy"] == max(fine)]
        table = own.pivot(index="problem", columns="solver", values="seconds")
        names = [name for name in self.problems.index if name in table.index]
        return table.loc[names, list(dict.fromkeys(self.times["solver"]))], float(max(fine))

    def write(self, path: Path) -> None:
        """Write the table as the package has it."""
        wide = self.times.pivot(index=["problem", "solver"], columns="accuracy", values="seconds")
        wide.columns = [f"{accuracy:.0e}" for accuracy in wide.columns]
        rows = self.times[["problem", "solver"]].drop_duplicates()
        whole = rows.join(self.problems, on="problem").join(wide, on=["problem", "solver"])
        whole.to_parquet(path, index=False, compression="zstd")


def measured_in(run: RunFrames) -> Measured:
    """Return what a run measured, on those of its problems that are still there with the same numbers.

    Raises:
        BenchError: if it is a study, or has no such problem.
    """
    refuse_unfit(run)
    known = {name: problem for name in run.cases["problem"].unique() if (problem := _held(run, str(name))) is not None}
    if not known:
        raise BenchError(f"the problems of {run.folder} are not there any more with the same numbers; measure anew.")
    families = dict(zip(run.cases["problem"], run.cases["family"], strict=True))
    rows: dict[str, Any] = {name: [families[name], *features(problem)] for name, problem in known.items()}
    problems = pd.DataFrame.from_dict(rows, orient="index", columns=["family", *FEATURES])
    times = attempts(run, accuracies(run))[["problem", "solver", "accuracy", "seconds"]]
    return Measured(str(run.folder), problems, times[times["problem"].isin(known)].reset_index(drop=True))


def shipped() -> Measured:
    """Return what the package was measured on: its own problems and public ones."""
    with files(__package__).joinpath(SHIPPED).open("rb") as file:
        whole = pd.read_parquet(file)
    problems = whole.drop_duplicates("problem").set_index("problem")[["family", *FEATURES]]
    accuracy = [name for name in whole if name not in ("problem", "solver", "family", *FEATURES)]
    times = whole.melt(["problem", "solver"], accuracy, "accuracy", "seconds").astype({"accuracy": np.float64})
    return Measured("the table of the package", problems, times)


def _held(run: RunFrames, name: str) -> ContactProblem | None:
    """Return a problem of a run with the numbers that were measured; None if it is there no more."""
    digest = run.cases.loc[run.cases["problem"] == name, "digest"].iloc[0]
    with suppress(ProxbenchError):
        carried = run.info.carried
        problem = Store.open(run.folder).read_problem(carried[name]) if name in carried else load(name)
        if problem.digest == digest:
            return problem
    return None
