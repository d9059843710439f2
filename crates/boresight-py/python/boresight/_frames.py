"""Frames of any array type: what the library does not take as it is becomes an array that it does.

The library takes rows x columns of u8, u16, f32, and rows x columns x 3 of u8, native byte order. Those are copied once, straight into
the frame; everything below costs one copy more.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ._errors import BoresightError

_GREY = np.array([0.299, 0.587, 0.114], dtype=np.float32)


def as_array(value: Any) -> np.ndarray[Any, Any]:
    """Any array-like object (OpenCV, imageio, tifffile, pims, dask, torch on the CPU) as a NumPy array."""
    if isinstance(value, np.ndarray):
        return value
    if not hasattr(value, "__array__") and hasattr(value, "__dlpack__"):
        return np.from_dlpack(value)
    try:
        return np.asarray(value)
    except (TypeError, ValueError, RuntimeError) as e:
        raise BoresightError(
            f"cannot be read as an array: {e}",
            where=f"a {type(value).__name__}",
            hint="give NumPy arrays, or objects with __array__ or __dlpack__ in the computer's own memory",
        ) from e


def normalise(value: Any) -> np.ndarray[Any, Any]:
    """The frame as an array of a pixel type that the library has: u8, u16 or f32 grey, u8 colour.

    bool becomes 0 and 255; other integers and f64 become f32; RGBA loses its alpha; colour that is not u8 becomes grey.
    """
    a = as_array(value)
    if a.dtype.kind not in "buif":
        raise BoresightError(
            f"pixels of type {a.dtype}: expected numbers",
            where="frame",
            hint="bool, integers and floats are taken; of complex data give the magnitude",
        )
    if a.ndim == 3 and a.shape[2] == 1:
        a = a[:, :, 0]
    if a.ndim == 3 and a.shape[2] == 4:
        a = a[:, :, :3]
    if not (a.ndim == 2 or (a.ndim == 3 and a.shape[2] == 3)):
        raise BoresightError(
            f"an array of shape {a.shape}: expected rows x columns, or rows x columns x 3",
            where="frame",
            hint="a stack is given as an iterable: bs.track(stack); channels come last: frame.transpose(1, 2, 0)",
        )
    if a.dtype.kind == "b":
        a = a.astype(np.uint8) * np.uint8(255)
    if a.ndim == 3 and a.dtype != np.uint8:
        a = a.astype(np.float32) @ _GREY
    keep = (a.dtype.kind, a.dtype.itemsize) in {("u", 1), ("u", 2), ("f", 4)}
    kind = a.dtype.newbyteorder("=") if keep else np.dtype(np.float32)
    return np.require(a, dtype=kind, requirements=["C", "A"])


def numbers(value: Any, name: str) -> np.ndarray[Any, Any]:
    """An array-like object as contiguous f64."""
    try:
        return np.array(as_array(value), dtype=np.float64, order="C")
    except (TypeError, ValueError) as e:
        raise BoresightError(f"expected numbers: {e}", where=name, hint="an array of floats") from e
