"""Print the gain of a warm start on each motion of the suite ``sequences``, in Markdown.

``python tests/speed/starts_table.py [starts.csv]`` reads the table that ``proxbench run --suite sequences`` writes. A
cell has the mean iterations (from zero → warm) and the geometric mean times [ms]. Times are over the steps without
excluded times; their number follows in brackets if it is less than that of the steps.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd

STARTS = Path(__file__).parents[2] / "results" / "sequences" / "tables" / "starts.csv"


def markdown(starts: pd.DataFrame) -> str:
    """Return a row for each family and tolerance, and a column for each solver."""
    solvers = [*dict.fromkeys(starts["solver"])]
    lines = [
        f"| motion | to | {' | '.join(f'`{name}`' for name in solvers)} |",
        f"| --- | --- |{' ---: |' * len(solvers)}",
    ]
    for family, rows in starts.groupby("family", sort=False):
        title = f"`{str(family).removeprefix('sequence: ')}`"
        for tolerance, own in rows.groupby("tolerance", sort=False):
            cells = own.set_index("solver").apply(cell, axis=1).reindex(solvers, fill_value="–")
            lines.append(f"| {title} | {tolerance:.0e} | {' | '.join(cells)} |".replace("e-0", "e-"))
            title = ""
    return "\n".join(lines).replace("|  |", "| |")


def cell(row: pd.Series) -> str:
    """Return the iterations and times of one solver."""
    text = f"{row['cold_iterations']:.4g} → {row['warm_iterations']:.4g}"
    if row["timed"] == 0:
        return text
    cold, warm = (_two_digits(1e3 * row[name]) for name in ("cold_seconds", "warm_seconds"))
    count = f" ({row['timed']})" if row["timed"] < row["problems"] else ""
    return f"{text}; {cold} → {warm}{count}"


def _two_digits(value: float) -> str:
    return np.format_float_positional(value, precision=2, fractional=False, trim="-")


if __name__ == "__main__":
    print(markdown(pd.read_csv(sys.argv[1] if len(sys.argv) > 1 else STARTS)))
