"""How far a run is: a bar of tqdm where that is installed, else one line that is written over."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

Tell = Callable[[int, int | None], Any]


@contextmanager
def bar(progress: bool | Tell | None) -> Iterator[Tell | None]:
    """The function that is told of frames done and all; `None` asks for none."""
    if callable(progress):
        yield progress
        return
    if progress is False or (progress is None and not _is_watched()):
        yield None
        return
    line = _tqdm() or _Line()
    try:
        yield line.tell
    finally:
        line.close()


def _is_watched() -> bool:
    return "ipykernel" in sys.modules or bool(getattr(sys.stderr, "isatty", bool)())


def _tqdm() -> Any:
    try:
        from tqdm.auto import tqdm
    except ImportError:
        return None

    class Bar:
        def __init__(self) -> None:
            self.bar = tqdm(unit="frame", leave=False)

        def tell(self, done: int, total: int | None) -> None:
            self.bar.total = total
            self.bar.update(done - self.bar.n)

        def close(self) -> None:
            self.bar.close()

    return Bar()


class _Line:
    def __init__(self) -> None:
        self.began = time.monotonic()
        self.width = 0

    def tell(self, done: int, total: int | None) -> None:
        text = f"{done} frames" if total is None else f"{done} of {total} frames"
        spent = time.monotonic() - self.began
        if total and 0 < done < total:
            text += f", {spent / done * (total - done):.0f} s left"
        sys.stderr.write("\r" + text.ljust(self.width))
        sys.stderr.flush()
        self.width = len(text)

    def close(self) -> None:
        if self.width:
            sys.stderr.write("\r" + " " * self.width + "\r")
            sys.stderr.flush()
