"""Keyword arguments as keys of the configuration: `tracker__coast_s=1` is `tracker.coast-s=1`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from ._errors import BoresightError


def toml(value: Any, key: str) -> str:
    """A value as TOML text."""
    if hasattr(value, "item") and getattr(value, "ndim", None) == 0:
        value = value.item()
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, Mapping):
        inner = ", ".join(f"{k.replace('_', '-')} = {toml(v, key)}" for k, v in value.items())
        return "{" + inner + "}"
    if isinstance(value, list | tuple) or hasattr(value, "tolist"):
        listed = value.tolist() if hasattr(value, "tolist") else value
        return "[" + ", ".join(toml(v, key) for v in listed) + "]"
    raise BoresightError(
        f"a value of type {type(value).__name__}: expected a number, a truth value, a text, a list or a dictionary",
        where=key,
        hint="`boresight config --explain KEY` and docs/config.md say what a key takes",
    )


def assignments(sets: Mapping[str, Any], filter: str | Mapping[str, Any] | None = None, associator: str | None = None) -> list[str]:
    """What the library calls `--set`: `key=value`, in the order given; `filter` and `associator` are short for theirs."""
    out = []
    if filter is not None:
        out.append(f"tracker.filter={toml(filter, 'filter')}")
    if associator == "mht":
        out.append("tracker.mht={}")
    elif associator is not None:
        out.append(f"tracker.associator.{associator}={{}}")
    for name, value in sets.items():
        key = name.replace("__", ".").replace("_", "-")
        if "." not in key:
            raise BoresightError(
                "there is no such argument, and keys of the configuration name their part",
                where=name,
                hint="two underlines stand for the dot: tracker__coast_s=1.0 sets tracker.coast-s",
            )
        out.append(f"{key}={toml(value, key)}")
    return out
