"""Training curves as CSV, one row per step or per validation."""

import csv
from pathlib import Path

from .atomic import write_atomically


class Curve:
    """An append-only CSV whose first column is the step."""

    def __init__(self, path: Path, columns: list[str], *, before_step: int):
        """Keeps the rows of steps before `before_step` (a resumed run repeats the others)."""
        self.path, self.columns = Path(path), ["step", *columns]
        # As text: a number that is read and written again would gain digits.
        rows = []
        if self.path.exists():
            with open(self.path, newline="") as handle:
                rows = [row for row in csv.DictReader(handle) if int(row["step"]) < before_step]

        def write(temporary: Path) -> None:
            with open(temporary, "w", newline="") as handle:
                writer = csv.DictWriter(handle, self.columns)
                writer.writeheader()
                writer.writerows(rows)

        write_atomically(self.path, write)

    def append(self, **values: float) -> None:
        """Adds one row; a column that is not given stays empty."""
        with open(self.path, "a", newline="") as handle:
            csv.DictWriter(handle, self.columns).writerow(
                {name: value if isinstance(value, int) else f"{value:.6g}" for name, value in values.items()}
            )


def read_curve(path: Path) -> list[dict[str, float]]:
    """The rows of a curve as numbers; empty cells are left out."""
    with open(path, newline="") as handle:
        rows = [{name: float(cell) for name, cell in row.items() if cell} for row in csv.DictReader(handle)]
    for row in rows:
        row["step"] = int(row["step"])
    return rows
