"""The package's exception and its warning."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ._tracks import Tracks


class BoresightError(Exception):
    """What went wrong, where, and how to mend it.

    Attributes:
        kind: `config`, `not-found`, `damaged`, `unsupported`, `missing-tool`, `output`, `numeric` or `interrupted`.
        where: the place: file, line, key, frame; `None` if there is none to name.
        hint: how to mend it, or `None`.
        partial: the tracks of the frames before an input broke off, or `None`.
    """

    def __init__(self, message: str = "", *, kind: str = "config", where: str | None = None, hint: str | None = None) -> None:
        super().__init__(message)
        self.kind = kind
        self.where = where
        self.hint = hint
        self.partial: Tracks | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        """Keep the attributes through pickle (processes of a pool)."""
        return _rebuilt, (str(self), self.kind, self.where, self.hint)


def _rebuilt(message: str, kind: str, where: str | None, hint: str | None) -> BoresightError:
    return BoresightError(message, kind=kind, where=where, hint=hint)


class BoresightWarning(UserWarning):
    """What was lost of the input, or made up."""
