"""What the stress tests tried, and the worst that they found: the rows of the tables in docs/numerics.md."""

from __future__ import annotations

import re
from dataclasses import dataclass


@dataclass
class Row:
    """One line of a table: the worst of all cases that a test tried of one thing."""

    tried: str
    cases: int
    worst: float
    bound: float
    unit: str


class Ledger:
    """Collects rows under (section, what); a section is a table of the page."""

    def __init__(self) -> None:
        self.rows: dict[tuple[str, str], Row] = {}

    def record(
        self, section: str, what: str, tried: str, *, cases: int, worst: float, bound: float, unit: str = ""
    ) -> None:
        """Note what was tried, and fail where the worst error found exceeds the bound promised.

        section : "kernels", "scenes", "agreement", "files" or "faults"
        what : the kernel, scene or kind of file
        cases : how many generated cases went into `worst`; calls with the same `what` add up
        worst : the largest error found, in `unit`; not a number fails
        """
        worst = float(worst)
        row = self.rows.setdefault((section, what), Row(tried, 0, 0.0, float(bound), unit))
        row.cases += int(cases)
        row.worst = max(row.worst, worst) if worst == worst else worst
        assert worst <= bound, f"{what}: {worst:g} {unit} found, {bound:g} promised ({tried})"

    def cases(self, *sections: str) -> int:
        """Return how many cases were tried in all, or in some sections."""
        return sum(row.cases for (section, _), row in self.rows.items() if not sections or section in sections)

    def table(self, section: str) -> str:
        """Return a section's rows as a Markdown table."""
        lines = ["| what | tried | cases | worst found | promised |", "|---|---|---|---|---|"]
        for (each, what), row in self.rows.items():
            if each == section:
                worst, bound = (f"{value:.2g} {row.unit}".strip() for value in (row.worst, row.bound))
                lines.append(f"| {what} | {row.tried} | {row.cases:,} | {worst} | {bound} |")
        return "\n".join(lines)


def fill_in(page: str, ledger: Ledger) -> str:
    """Return the page with the tables between its markers, `<!-- stress:kernels -->` to `<!-- /stress:kernels -->`.

    Sections of which nothing was tried keep what they have.
    """
    for section in {section for section, _ in ledger.rows}:
        opening, closing = f"<!-- stress:{section} -->", f"<!-- /stress:{section} -->"
        # The table may hold backslashes, which a replacement text would read as groups.
        table = f"{opening}\n\n{ledger.table(section)}\n\n{closing}"
        page = re.sub(f"{opening}.*?{closing}", lambda _, text=table: text, page, flags=re.DOTALL)
    return page
