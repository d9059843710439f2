"""Every Python example of the chapters and of the README is run, the blocks of a page in order in one folder.

A block fenced as `python` is run as it stands; after it may stand `needs=NAME`: left out, and said, where that module is not installed.
"""

from __future__ import annotations

import importlib.util
import re
import warnings

import pytest
from conftest import ROOT

PAGES = ["README.md", "docs/python.md", "docs/batch.md", *(f"docs/from-{name}.md" for name in ("trackpy", "sort", "filterpy", "stonesoup"))]
FENCE = re.compile(r"^```python(?P<words>[^\n]*)\n(?P<code>.*?)^```$", re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize("page", PAGES)
def test_the_examples_of_a_page_run(page, tmp_path, monkeypatch, capsys):
    text = (ROOT / page).read_text(encoding="utf-8")
    blocks = list(FENCE.finditer(text))
    assert blocks, f"{page} has no example"
    (tmp_path / "samples").symlink_to(ROOT / "samples")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for block in blocks:
        need = re.search(r"needs=(\w+)", block["words"])
        if need and importlib.util.find_spec(need[1]) is None:
            warnings.warn(f"{page}: a block that needs {need[1]} is left out", stacklevel=1)
            continue
        line = text[: block.start()].count("\n") + 2
        # Blank lines before, so that an error names the page's own line.
        exec(compile("\n" * (line - 1) + block["code"], page, "exec"), names)
    assert "error" not in capsys.readouterr().err.lower()
