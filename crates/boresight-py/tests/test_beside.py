"""The side-by-side pages: each example prints the table that its page shows, as far as it does not tell of time."""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys

import pytest
from conftest import ROOT

EXAMPLES = ROOT / "crates/boresight-py/examples"
# Example with its options, page, what it needs.
PAGES = [
    ("beside_trackpy.py", "from-trackpy.md", ["trackpy"]),
    ("beside_filterpy.py", "from-filterpy.md", ["filterpy"]),
    ("beside_sort.py", "from-sort.md", ["filterpy", "scipy", "supervision"]),
    ("beside_sort.py --bounce", "from-sort.md", ["filterpy", "scipy", "supervision"]),
    ("beside_stonesoup.py", "from-stonesoup.md", ["stonesoup"]),
]


def cells(text: str) -> list[list[str]]:
    """The rows of a table in Markdown, without the rule below its head."""
    rows = [[c.strip() for c in line.strip()[1:-1].split("|")] for line in text.splitlines() if line.startswith("|")]
    return [r for r in rows if not set("".join(r)) <= set("-| ")]


@pytest.mark.parametrize(("example", "page", "needs"), PAGES, ids=[p[0] for p in PAGES])
def test_the_example_prints_the_table_of_its_page(example, page, needs):
    for name in needs:
        if importlib.util.find_spec(name) is None:
            pytest.skip(f"{name} is not installed")
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    assert example.split()[0] in text, f"{page} does not name {example}"
    script, *options = example.split()
    done = subprocess.run([sys.executable, EXAMPLES / script, *options], capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    printed, shown = cells(done.stdout), cells(text)
    assert len(printed) > 3, done.stdout
    head = printed[0]
    for row in printed:
        same = [r for r in shown if r[0] == row[0] and len(r) == len(row)]
        assert same, f"{page} does not show the row {row}"
        assert any(all(map(alike, head, row, r)) for r in same), f"{page} shows {same}, printed is {row}"


def alike(head: str, printed: str, shown: str) -> bool:
    """Whether two cells say the same: times and rounding errors may differ, scores by 0.02, counts by a fifth."""
    if printed == shown or "time" in head or "e-" in shown:
        return True
    try:
        a, b = float(printed), float(shown)
    except ValueError:
        return False
    return abs(a - b) <= (0.02 if re.search(r"\.", shown) else max(2.0, 0.2 * abs(b)))
