"""Types of the native part; the modules beside it are what users import."""

import os
from collections.abc import Iterator
from typing import Any, final

import numpy as np
from numpy.typing import NDArray
from typing_extensions import Self, disjoint_base

__all__ = [
    "Batch",
    "Config",
    "Filter",
    "Rows",
    "States",
    "Table",
    "TrackState",
    "Tracker",
    "__version__",
    "choose_for_arrays",
    "choose_for_path",
    "choose_for_scans",
    "cpu_features",
    "detect_arrays",
    "detect_path",
    "evaluate",
    "scenes",
    "simulate",
    "time_of_updates",
    "track_arrays",
    "track_columns",
    "track_path",
]

__version__: str

def cpu_features() -> list[str]: ...

@final
class Config:
    def __new__(cls, sets: list[str] = ...) -> Self: ...
    @staticmethod
    def from_toml(text: str, name: str) -> Config: ...
    @staticmethod
    def from_file(path: str | os.PathLike[str]) -> Config: ...
    @staticmethod
    def preset(name: str) -> Config: ...
    @staticmethod
    def presets() -> list[str]: ...
    def with_sets(self, sets: list[str]) -> Config: ...
    def to_toml(self) -> str: ...
    @property
    def reasons(self) -> list[str]: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...

@final
class Rows:
    """The rows of a run; `Tracks` wraps it."""

    STATUS: list[str]
    def __len__(self, /) -> int: ...
    @property
    def warnings(self) -> list[str]: ...
    @property
    def label(self) -> str: ...
    @property
    def config(self) -> Config: ...
    @property
    def summary(self) -> dict[str, Any]: ...
    def columns_as_arrays(self) -> dict[str, NDArray[Any]]: ...
    def scores(self) -> NDArray[np.float32]: ...
    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object: ...
    def write(self, path: str | os.PathLike[str], format: str) -> list[str]: ...
    def report(self, path: str | os.PathLike[str]) -> None: ...

@final
class TrackState:
    """One track after one scan.

    Pixels count from the centre of the top-left pixel; `box` alone has corners as object detectors give them (the first pixel begins at 0).
    """

    @property
    def id(self) -> int: ...
    @property
    def status(self) -> str:
        """`tentative`, `confirmed` or `coasting` (confirmed, no detection in this scan)."""
    @property
    def is_confirmed(self) -> bool: ...
    @property
    def position(self) -> NDArray[np.float64]:
        """x, y, px."""
    @property
    def velocity(self) -> NDArray[np.float64]:
        """vx, vy, px/s."""
    @property
    def covariance(self) -> NDArray[np.float64]:
        """Of the position, 2 x 2, px²."""
    @property
    def state(self) -> NDArray[np.float64]:
        """`[x, vx, y, vy]`, px and px/s."""
    @property
    def state_covariance(self) -> NDArray[np.float64]:
        """Of the state, 4 x 4."""
    @property
    def box(self) -> NDArray[np.float64]:
        """Left, top, right, bottom, px."""
    @property
    def score(self) -> float: ...
    @property
    def detection(self) -> int | None:
        """Number of the detection of this scan that the track took."""
    @property
    def nis(self) -> float | None:
        """Normalised innovation squared of this scan's update; 2 in the mean if the uncertainty is honest."""

@final
class States:
    """All tracks after one scan: a sequence of `TrackState`, and arrays over all of them in the same order."""

    def __len__(self, /) -> int: ...
    def __getitem__(self, index: int, /) -> TrackState: ...
    def __iter__(self) -> Iterator[TrackState]: ...
    @property
    def frame(self) -> int: ...
    @property
    def time_s(self) -> float: ...
    @property
    def confirmed(self) -> States:
        """Those that are confirmed, coasting ones among them."""
    @property
    def ids(self) -> NDArray[np.int64]: ...
    @property
    def statuses(self) -> list[str]: ...
    @property
    def positions(self) -> NDArray[np.float64]:
        """N x 2, px."""
    @property
    def velocities(self) -> NDArray[np.float64]:
        """N x 2, px/s."""
    @property
    def covariances(self) -> NDArray[np.float64]:
        """Of the positions, N x 2 x 2, px²."""
    @property
    def state_covariances(self) -> NDArray[np.float64]:
        """Of `[x, vx, y, vy]`, N x 4 x 4."""
    @property
    def boxes(self) -> NDArray[np.float64]:
        """N x 4, left, top, right, bottom, px."""
    @property
    def scores(self) -> NDArray[np.float32]: ...
    @property
    def detections(self) -> NDArray[np.int64]:
        """Number of the detection taken, -1 for none."""
    def tracks_of_detections(self) -> NDArray[np.int64]:
        """For each detection of the scan the place of the confirmed track that took it, -1 for none."""

@disjoint_base
class Tracker:
    def __new__(cls, config: Config) -> Self: ...
    @property
    def native_config(self) -> Config: ...
    def step(self, frame: Any, time_s: float | None = None) -> States:
        """Detects and tracks in one frame: rows x columns, or x 3 for colour. `time_s` rises; else the configuration's rate holds."""
    def update_native(
        self,
        positions: Any = None,
        boxes: Any = None,
        covariances: Any = None,
        scores: Any = None,
        classes: Any = None,
        std_px: float | None = None,
        std_per_side: float | None = None,
        time_s: float | None = None,
    ) -> States: ...
    def reset(self) -> None:
        """Forgets all tracks; ids begin at 1 again."""

@disjoint_base
class Filter:
    def __new__(cls, form: str, model: str, parameters: list[float], x: NDArray[np.float64], p: NDArray[np.float64]) -> Self: ...
    def predict(self, dt_s: float) -> None:
        """Moves the belief `dt_s` seconds ahead."""
    def correct_native(self, z: NDArray[np.float64], r: NDArray[np.float64]) -> None: ...
    def log_likelihood_native(self, z: NDArray[np.float64], r: NDArray[np.float64]) -> float: ...
    @property
    def x(self) -> NDArray[np.float64]:
        """Mean of the state."""
    @property
    def P(self) -> NDArray[np.float64]:
        """Its covariance."""
    @property
    def position(self) -> NDArray[np.float64]:
        """x, y, px."""
    @property
    def covariance(self) -> NDArray[np.float64]:
        """Of the position, 2 x 2, px²."""

@disjoint_base
class Batch:
    def __new__(cls, q: float, x: NDArray[np.float64], p: NDArray[np.float64]) -> Self: ...
    def __len__(self, /) -> int: ...
    def step_native(self, dt_s: float, z: NDArray[np.float64], r: NDArray[np.float64]) -> int: ...
    @property
    def x(self) -> NDArray[np.float64]:
        """N x 4, `[x, vx, y, vy]`."""
    @property
    def P(self) -> NDArray[np.float64]:
        """N x 4 x 4."""

@final
class Table:
    """A table of tracks."""

    @staticmethod
    def from_path(path: str | os.PathLike[str], tentative: bool = False) -> Table: ...
    @staticmethod
    def from_rows(rows: Rows, tentative: bool = False) -> Table: ...
    @staticmethod
    def from_columns(
        frame: NDArray[np.int64],
        id: NDArray[np.int64],
        boxes: NDArray[np.float64],
        states: NDArray[np.float64],
        points: bool,
    ) -> Table: ...

def track_path(path: str, request: dict[str, Any]) -> Rows: ...
def track_arrays(frames: Any, n_frames: int | None, times: list[float] | None, twice: bool, request: dict[str, Any]) -> Rows: ...
def track_columns(
    frames: NDArray[np.int64],
    positions: NDArray[np.float64],
    covariances: NDArray[np.float64],
    sizes: NDArray[np.float64],
    request: dict[str, Any],
) -> Rows: ...
def choose_for_path(path: str, request: dict[str, Any]) -> Config: ...
def choose_for_arrays(frames: Any, n_frames: int | None, times: list[float] | None, twice: bool, request: dict[str, Any]) -> Config: ...
def choose_for_scans(scans: list[Any], times: list[float] | None, request: dict[str, Any]) -> Config: ...
def detect_path(path: str, request: dict[str, Any]) -> tuple[dict[str, NDArray[Any]], Config]: ...
def detect_arrays(
    frames: Any, n_frames: int | None, times: list[float] | None, twice: bool, request: dict[str, Any]
) -> tuple[dict[str, NDArray[Any]], Config]: ...
def evaluate(
    truth: Table,
    result: Table,
    *,
    distance_px: float | None = None,
    min_overlap: float = 0.5,
    cutoff_px: float = 10.0,
    order: float = 2.0,
    rate_hz: float | None = None,
    size_px: tuple[float, float] | None = None,
    all_measures: bool = True,
) -> tuple[dict[str, tuple[float, str, str]], list[str]]: ...
def scenes() -> list[tuple[str, str]]: ...
def simulate(
    name: str, toml: str | None, seed: int, run: int, n_frames: int | None
) -> tuple[list[NDArray[Any]], list[float], Rows, float]: ...
def time_of_updates(config: Config, scans: list[Any], dt_s: float) -> float: ...
