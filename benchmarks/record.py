"""Measured speed in a JSON file, which the tables of the docs are made from.

Of each section what it was measured on, in Markdown, and its tables.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from benchmarks.measure import Row, Table


def write_section(path: Path, name: str, measured_on: list[str], tables: list[Table]) -> None:
    """Put a section into the file, in the place of an older one; the others stay."""
    sections: dict[str, Any] = json.loads(path.read_text()) if path.exists() else {}
    rounded = [asdict(table) for table in tables]
    for row in (row for table in rounded for row in table["rows"]):
        for kind in ("figures", "of_roof"):
            row[kind] = [float(f"{figure:.6g}") for figure in row[kind]]
    sections[name] = {"measured_on": measured_on, "tables": rounded}
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(sections, indent=1) + "\n")


def read_sections(path: Path) -> dict[str, tuple[list[str], list[Table]]]:
    """By name what each section was measured on, and its tables."""
    return {
        name: (section["measured_on"], [_table(**table) for table in section["tables"]])
        for name, section in json.loads(path.read_text()).items()
    }


def _table(title: str, rows: list[dict[str, Any]], notes: list[str]) -> Table:
    return Table(title, [Row(**row) for row in rows], notes)
