"""Joint feature tracking for structure from motion in dark, noisy video.

    import cohort

    tracks = cohort.track("night.mp4")
    model = cohort.reconstruct(tracks)
    print(model.quality, model.cam_from_world.shape, model.points.shape)

The centre of the top-left pixel is (0, 0). A pose takes a point of the world into the camera's
frame: x right, y down, z ahead. Options are keywords with the names that the program's
--dump-config prints; a group of them is a dict: detector={"max_features": 500}.
"""

from __future__ import annotations

import dataclasses
import json
import logging
import operator
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Literal, NamedTuple, Optional, Union

import numpy as np
import numpy.typing as npt

from . import _cohort
from ._cohort import Camera, Error, UsageError, __version__

__all__ = [
    "OBSERVATION",
    "Camera",
    "DenseTracks",
    "Doubt",
    "Error",
    "Reconstruction",
    "Tracks",
    "UsageError",
    "__version__",
    "default_options",
    "reconstruct",
    "refine",
    "track",
]

Path = Union[str, "os.PathLike[str]"]
Array = npt.NDArray[Any]
# progress(stage, done, total): called after every frame; total is None if it is unknown. What
# it raises ends the job.
Progress = Callable[[str, int, Optional[int]], object]
# A video, a folder or glob of images, a folder in TUM RGB-D, EuRoC or KITTI layout; or frames:
# arrays (height, width) or (height, width, 3) of uint8 or uint16.
Clip = Union[Path, Iterable[Array]]

# The columns of Tracks.observations.
OBSERVATION: np.dtype[Any] = _cohort.OBSERVATION

_log = logging.getLogger("cohort")
_MOST_FRAMES = 10_000_000
_ma: Any = np.ma  # its functions have no types

# Options of the program that name files, or that only a program can have.
_OF_THE_PROGRAM = ("input", "out", "resume", "json", "tracks", "model", "images")


class DenseTracks(NamedTuple):
    """Tracks as arrays over T frames and N tracks; NaN where a track has no position."""

    xy: Array  # (T, N, 2) [px]
    observed: Array  # (T, N) bool: the image confirms it; False: predicted, or none
    covariances: Array  # (T, N, 2, 2) [px^2]
    frames: Array  # (T,) which frame of the clip
    track_ids: Array  # (N,)


class Tracks:
    """Feature tracks of a clip, as a .tracks file holds them. They do not change."""

    def __init__(self, file: _cohort.TrackFile) -> None:
        self._file = file
        self._observations: Optional[Array] = None

    @staticmethod
    def read(path: Path) -> Tracks:
        """Reads a .tracks file."""
        return Tracks(_cohort.read_tracks(path))

    @staticmethod
    def read_csv(
        path: Path,
        *,
        width_px: int,
        height_px: int,
        camera: Optional[Camera] = None,
        frames: Optional[int] = None,
    ) -> Tracks:
        """Reads track_id,frame,x,y[,observed][,residual] of pictures of that size.

        What lies outside of them counts as predicted.
        """
        rows, doubts = _cohort.read_csv(path, width_px, height_px)
        for doubt in doubts:
            _log.warning("%s", doubt)
        return Tracks.from_observations(
            rows,
            width_px=width_px,
            height_px=height_px,
            camera=camera,
            frames=frames,
        )

    @staticmethod
    def read_colmap_database(path: Path) -> Tracks:
        """The tracks that a database's verified matches make; its images are the frames.

        Of any program's database of COLMAP 3.8 to 4.x with one camera. Its names of pictures are
        relative to COLMAP's image folder: refine() needs the clip. Frames go by the ids of the
        images; that they are not in the order of the names is said.
        """
        return _with_doubt(*_cohort.read_colmap_database(path))

    @staticmethod
    def from_observations(
        rows: Union[Array, Mapping[str, npt.ArrayLike]],
        *,
        width_px: int,
        height_px: int,
        camera: Optional[Camera] = None,
        frames: Union[int, npt.ArrayLike, None] = None,
    ) -> Tracks:
        """Tracks of any tracker, a row an observation.

        `rows`: a structured array, or arrays by column, of frame, track_id, x, y and any of
        observed (True without), residual (0), cov_xx, cov_xy, cov_yy [px^2] (none). `frames`: how
        many the clip has, or which, ascending; without, up to the last one observed. What lies
        outside the pictures counts as predicted.
        """
        table = rows if isinstance(rows, Mapping) else {n: rows[n] for n in rows.dtype.names or ()}
        columns = {name: _unmasked(name, column) for name, column in table.items()}
        missing = [name for name in ("frame", "track_id", "x", "y") if name not in columns]
        if missing:
            raise UsageError(f"the observations have no column {missing[0]}")
        unknown = [name for name in columns if name not in (OBSERVATION.names or ())]
        if unknown:
            raise UsageError(f"the observations have a column {unknown[0]}, which is unknown")
        count = columns["frame"].size
        array = np.zeros(count, OBSERVATION)
        array["observed"] = True
        for name in ("cov_xx", "cov_xy", "cov_yy"):
            array[name] = np.nan
        for name, column in columns.items():
            if column.shape != (count,):
                raise UsageError(f"column {name} has the shape {column.shape}, frame ({count},)")
            if name in ("frame", "track_id"):
                _require_ids(f"column {name}", column)
            array[name] = _flags(name, column) if name == "observed" else column
        if frames is None:
            frames = int(array["frame"].max()) + 1 if count else 0
        numbers = _numbers("frames", range(_count(frames)) if np.ndim(frames) == 0 else frames)
        return _with_doubt(*_cohort.make_tracks(array, numbers, width_px, height_px, camera))

    @staticmethod
    def from_dense(
        xy: npt.ArrayLike,
        observed: Optional[npt.ArrayLike] = None,
        covariances: Optional[npt.ArrayLike] = None,
        *,
        width_px: int,
        height_px: int,
        camera: Optional[Camera] = None,
        frames: Optional[npt.ArrayLike] = None,
        track_ids: Optional[npt.ArrayLike] = None,
    ) -> Tracks:
        """Tracks of any tracker: xy (T, N, 2), NaN where there is none.

        `observed` (T, N): which positions the image confirms, often called visibility, True or
        False; all without. Of a masked array what is masked is NaN.
        `covariances` (T, N, 2, 2) [px^2], NaN where unknown. `frames` (T,): which of the clip
        they are, ascending; `track_ids` (N,); both are counted from 0 without. What lies outside
        the pictures counts as predicted.
        """
        positions = _ma.filled(_ma.asarray(xy, np.float64), np.nan)
        if positions.ndim != 3 or positions.shape[2] != 2:
            raise UsageError(f"xy has the shape {positions.shape}: give (frames, tracks, 2)")
        shape = positions.shape[:2]
        frames = np.arange(shape[0]) if frames is None else _numbers("frames", frames)
        track_ids = np.arange(shape[1]) if track_ids is None else _numbers("track_ids", track_ids)
        if frames.shape != shape[:1] or track_ids.shape != shape[1:]:
            raise UsageError(
                f"there are {frames.size} frames and {track_ids.size} track_ids, xy has the shape "
                f"{positions.shape}"
            )
        frame, track_id = np.nonzero(~np.isnan(positions).any(axis=2))
        columns: dict[str, npt.ArrayLike] = {
            "frame": frames[frame],
            "track_id": track_ids[track_id],
            "x": positions[frame, track_id, 0],
            "y": positions[frame, track_id, 1],
        }
        if observed is not None:
            seen = _flags("observed", _unmasked("observed", observed))
            if seen.shape != shape:
                raise UsageError(f"observed has the shape {seen.shape}, xy has {positions.shape}")
            columns["observed"] = seen[frame, track_id]
        if covariances is not None:
            matrices = _ma.filled(_ma.asarray(covariances, np.float32), np.nan)
            if matrices.shape != (*shape, 2, 2):
                raise UsageError(
                    f"covariances have the shape {matrices.shape}, xy has {positions.shape}"
                )
            columns["cov_xx"] = matrices[frame, track_id, 0, 0]
            columns["cov_xy"] = matrices[frame, track_id, 0, 1]
            columns["cov_yy"] = matrices[frame, track_id, 1, 1]
        return Tracks.from_observations(
            columns, width_px=width_px, height_px=height_px, camera=camera, frames=frames
        )

    @property
    def observations(self) -> Array:
        """A row an observation (OBSERVATION), by track, then frame; covariances NaN if unknown."""
        if self._observations is None:
            self._observations = self._file.observations()
            self._observations.flags.writeable = False
        return self._observations

    def dense(self) -> DenseTracks:
        """The same as arrays over frames and tracks, which takes 49 bytes each of them."""
        rows = self.observations
        t = np.searchsorted(self.frames, rows["frame"])
        n = np.searchsorted(self.track_ids, rows["track_id"])
        shape = (len(self.frames), len(self.track_ids))
        xy = np.full((*shape, 2), np.nan)
        xy[t, n, 0] = rows["x"]
        xy[t, n, 1] = rows["y"]
        observed = np.zeros(shape, bool)
        observed[t, n] = rows["observed"]
        covariances = np.full((*shape, 2, 2), np.nan)
        covariances[t, n, 0, 0] = rows["cov_xx"]
        covariances[t, n, 0, 1] = covariances[t, n, 1, 0] = rows["cov_xy"]
        covariances[t, n, 1, 1] = rows["cov_yy"]
        return DenseTracks(xy, observed, covariances, self.frames, self.track_ids)

    @property
    def width_px(self) -> int:
        return self._file.width_px

    @property
    def height_px(self) -> int:
        return self._file.height_px

    @property
    def camera(self) -> Optional[Camera]:
        """None: nothing is known of it."""
        return self._file.camera

    @property
    def source(self) -> str:
        """What the tracks were made from; empty for frames that came as arrays."""
        return self._file.source

    @property
    def meta(self) -> dict[str, str]:
        """The tracker, its options, whether there was a second pass ..."""
        return self._file.meta

    @property
    def frames(self) -> Array:
        """(T,) which frames of the clip, counted from 0."""
        return self._file.frames

    @property
    def frame_names(self) -> list[str]:
        return self._file.frame_names

    @property
    def timestamps_ns(self) -> Array:
        return self._file.timestamps_ns

    @property
    def track_ids(self) -> Array:
        """(N,) ascending."""
        return self._file.track_ids

    @property
    def ends(self) -> list[tuple[int, int, str]]:
        """(track_id, last frame, why) of the tracks that ended before the clip did."""
        return self._file.ends

    def write(self, path: Path) -> None:
        """Writes a .tracks file, whole or not at all."""
        _cohort.write_tracks(path, self._file)

    def write_csv(self, path: Path) -> None:
        """Writes track_id,frame,x,y,observed,residual."""
        _cohort.write_csv(path, self._file)

    def write_colmap_database(self, path: Path, **options: Any) -> None:
        """Writes a database with verified matches, for COLMAP 3.8 to 4.x.

        Options: default_options("write_colmap_database").
        """
        _cohort.write_colmap_database(path, self._file, _to_json(options))

    def __repr__(self) -> str:
        return (
            f"<cohort.Tracks {len(self.track_ids)} tracks in {len(self.frames)} frames of "
            f"{self.width_px} x {self.height_px} px>"
        )


@dataclasses.dataclass(frozen=True)
class Doubt:
    """A reason to doubt a model; str() gives the sentence. docs/files.md lists the codes."""

    code: str  # does not change between versions
    sentence: str  # what is doubtful and what to do, for people; may change
    figures: dict[str, float]  # what it was judged by; without those that are infinite

    def __str__(self) -> str:
        return self.sentence


class Reconstruction:
    """Cameras and points of a clip, up to a similarity of the world."""

    def __init__(self, model: _cohort.Model) -> None:
        self._model = model
        try:
            self._summary: dict[str, Any] = json.loads(model.summary)
        except ValueError as error:
            raise Error(f"the model's summary.json is not valid JSON: {error}") from None
        reasons = self._summary.get("reasons", []) if isinstance(self._summary, dict) else None
        if not isinstance(reasons, list):
            raise Error("the model's summary.json does not have the form that cohort writes")
        self._reasons = [_doubt(reason) for reason in reasons]

    @staticmethod
    def read(folder: Path) -> Reconstruction:
        """Reads a model folder of cohort's, or another model of COLMAP's with ids like its."""
        return Reconstruction(_cohort.read_model(folder))

    @property
    def camera(self) -> Camera:
        """One camera takes all frames; its focal length may change (intrinsics)."""
        return self._model.camera

    @property
    def intrinsics(self) -> Array:
        """(R, 4) fx, fy, cx, cy of each frame: the camera's, or of a zoom the frame's own."""
        return self._model.intrinsics()

    @property
    def readout(self) -> float:
        """Rolling shutter: the share of the time between frames in which it takes all rows."""
        return self._model.readout

    @property
    def frames(self) -> Array:
        """(R,) the frames that have a pose."""
        return self._model.frames

    @property
    def frame_names(self) -> list[str]:
        return self._model.frame_names

    @property
    def cam_from_world(self) -> Array:
        """(R, 3, 4): x_in_cam = cam_from_world @ (x_in_world, 1)."""
        return self._model.poses()

    @property
    def centers(self) -> Array:
        """(R, 3): where the camera was, in the world."""
        poses = self.cam_from_world
        centers: Array = -np.einsum("rji,rj->ri", poses[:, :, :3], poses[:, :, 3])
        return centers

    @property
    def track_ids(self) -> Array:
        """(P,) the tracks that have a point, ascending."""
        return self._model.track_ids

    @property
    def points(self) -> Array:
        """(P, 3), in the world."""
        return self._model.points()

    @property
    def errors_px(self) -> Array:
        """(P,) mean reprojection error of each point."""
        return self._model.errors_px

    @property
    def views(self) -> Array:
        """A row (track_id, frame, x, y) an observation that bundle adjustment kept."""
        return self._model.views()

    @property
    def summary(self) -> dict[str, Any]:
        """What summary.json says (docs/files.md); empty where a folder has none."""
        return self._summary

    @property
    def failed(self) -> bool:
        """Fewer than 80 % of the frames have a pose."""
        return bool(self._summary.get("failed", len(self.frames) == 0))

    @property
    def quality(self) -> Optional[str]:
        """"good", "doubtful" or "failed"; None: a model that is not cohort's."""
        return self._summary.get("quality")

    @property
    def reasons(self) -> list[Doubt]:
        """Why to doubt it."""
        return list(self._reasons)

    def write(self, folder: Path) -> None:
        """Writes COLMAP's files, trajectory.tum, points.ply and summary.json."""
        _cohort.write_model(folder, self._model)

    def __repr__(self) -> str:
        return (
            f"<cohort.Reconstruction {len(self.frames)} cameras, {len(self.track_ids)} points"
            f"{', ' + self.quality if self.quality else ''}>"
        )


def track(
    clip: Clip,
    /,
    *,
    camera: Union[Camera, str, Sequence[float], None] = None,
    mask: Union[Path, Array, None] = None,
    channels: Literal["bgr", "rgb"] = "bgr",
    progress: Optional[Progress] = None,
    **options: Any,
) -> Tracks:
    """Tracks features through a clip: the work of `cohort track`.

    `clip`: a path (a video, images, a dataset), or an iterable of arrays, such as a list, a
    generator or one array (T, height, width), of which each has the shape (height, width) or
    (height, width, 3) and uint8 or uint16 pixels. With three channels they are blue, green, red as
    OpenCV has them, or channels="rgb". For the second pass they are kept, in grey:
    second_pass={"mode": "off"} needs no memory for them.

    `camera`: a Camera, or fx, fy, cx, cy and distortion as --camera takes them. Where only the
    focal length is known, and not well: the option camera_prior="1200+-60". `mask`: a picture or
    array (height, width), 0 where no feature may be, or a folder with a mask for each frame, as
    --mask takes it.

    Other options: default_options("track").
    """
    if isinstance(camera, str):
        options["camera"] = camera
    elif camera is not None and not isinstance(camera, Camera):
        options["camera"] = ",".join(str(word) for word in camera)
    mask_array, options["mask"] = _mask(mask)
    if not isinstance(clip, (str, os.PathLike)):
        for name in ("layout", "frames"):
            if _is_given(options.get(name)) and str(options[name]) != "auto":
                raise UsageError(f"option {name} is for clips that are read from files")
    of_pictures = camera if isinstance(camera, Camera) else None
    file = _cohort.track(
        clip, _to_json(options), _is_rgb(channels), mask_array, of_pictures, progress
    )
    if doubt := _cohort.doubt_of_camera(file):
        _log.warning("%s", doubt)
    if guess := _cohort.describe_focal_guess(file):
        _log.info("%s", guess)
    if "warning" in file.meta:
        _log.warning("%s", file.meta["warning"])
    if "cuts" in file.meta:
        _log.warning("the clip is cut at %s: all tracks end there", file.meta["cuts"])
    if file.meta.get("second_pass", "").startswith("none"):
        _log.warning("no second pass: %s", file.meta["second_pass"].removeprefix("none: "))
    return Tracks(file)


def reconstruct(
    tracks: Tracks,
    folder: Optional[Path] = None,
    *,
    progress: Optional[Progress] = None,
    **options: Any,
) -> Reconstruction:
    """Cameras and points from tracks: the work of `cohort reconstruct`.

    `folder`: where to write the model with its summary.json. A clip that gives no model is no
    exception: see Reconstruction.failed. Options: default_options("reconstruct"), such as
    backend="colmap".
    """
    file = _tracks(tracks)._file
    model = _cohort.reconstruct(file, folder, _to_json(options), progress)
    for warning in model.warnings:
        _log.warning("%s", warning)
    return Reconstruction(model)


def refine(
    tracks: Tracks,
    model: Reconstruction,
    clip: Optional[Clip] = None,
    *,
    mask: Union[Path, Array, None] = None,
    channels: Literal["bgr", "rgb"] = "bgr",
    progress: Optional[Progress] = None,
    **options: Any,
) -> Tracks:
    """Measures tracks again where a model says that they are: the work of `cohort refine`.

    `clip`: what the tracks were made of; without, Tracks.source. `mask`: as of track(); without,
    the one that they were made with, if it was a file. Options: default_options("refine").
    """
    _tracks(tracks)
    if not isinstance(model, Reconstruction):
        raise TypeError(f"model is a {type(model).__name__}: give a cohort.Reconstruction")
    if not len(model.track_ids):
        raise Error("the model has no points to measure: reconstruct first")
    mask_array, mask_path = _mask(mask)
    if clip is None and not tracks.source:
        raise UsageError("the tracks were made from frames that came as arrays: give them as clip")
    file, doubts = _cohort.refine(
        tracks._file,
        model._model,
        clip,
        _to_json(options),
        _is_rgb(channels),
        mask_array,
        mask_path,
        progress,
    )
    for doubt in doubts:
        _log.warning("%s", doubt)
    return Tracks(file)


def default_options(function: str) -> dict[str, Any]:
    """The options of track, reconstruct, refine or write_colmap_database, with their defaults.

    What each does: `cohort track --help-all` and so on.
    """
    options: dict[str, Any] = json.loads(_cohort.default_options(function))
    return {name: value for name, value in options.items() if name not in _OF_THE_PROGRAM}


def _to_json(options: Mapping[str, Any]) -> str:
    for name in _OF_THE_PROGRAM:
        if _is_given(options.get(name)):
            raise UsageError(f"option {name} is for the program only")
    kept = {name: value for name, value in options.items() if name not in _OF_THE_PROGRAM}
    try:
        return json.dumps(kept, default=_plain, allow_nan=False)
    except UsageError:
        raise
    except (TypeError, ValueError, RecursionError) as error:
        raise UsageError(f"the options cannot be represented as JSON: {error}") from None


def _plain(value: Any) -> Any:
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    raise UsageError(f"an option cannot be a {type(value).__name__}")


def _tracks(tracks: Tracks) -> Tracks:
    if not isinstance(tracks, Tracks):
        raise TypeError(f"tracks is a {type(tracks).__name__}: give cohort.Tracks (Tracks.read)")
    return tracks


def _with_doubt(file: _cohort.TrackFile, doubt: str) -> Tracks:
    if doubt:
        _log.warning("%s", doubt)
    return Tracks(file)


def _doubt(reason: Any) -> Doubt:
    try:
        figures = {str(name): float(value) for name, value in reason["figures"].items()}
        return Doubt(str(reason["code"]), str(reason["sentence"]), figures)
    except (AttributeError, KeyError, TypeError, ValueError):
        raise Error("the model's summary.json does not have the form that cohort writes") from None


def _mask(mask: Union[Path, Array, None]) -> tuple[Optional[Array], str]:
    """As an array, or as a path; neither."""
    if isinstance(mask, np.ndarray):
        return (mask.astype(np.uint8) * 255 if mask.dtype == bool else mask), ""
    return None, "" if mask is None else os.fspath(mask)


def _is_given(option: Any) -> bool:
    return isinstance(option, np.ndarray) or bool(option)


def _unmasked(name: str, values: npt.ArrayLike) -> Array:
    if _ma.is_masked(values):
        raise UsageError(f"{name} has masked values: leave those rows out")
    return np.asarray(values)


def _flags(name: str, values: Array) -> Array:
    if values.dtype.kind not in "biu":
        raise UsageError(f"{name} has {values.dtype} values: give True or False, as scores > 0.5")
    return values.astype(bool)


def _is_rgb(channels: str) -> bool:
    if channels not in ("bgr", "rgb"):
        raise UsageError(f"channels '{channels}': give bgr or rgb")
    return channels == "rgb"


def _count(frames: Any) -> int:
    count = operator.index(frames)
    if not 0 <= count <= _MOST_FRAMES:
        raise UsageError(f"a clip of {count} frames: up to {_MOST_FRAMES} are supported")
    return count


def _numbers(name: str, values: npt.ArrayLike) -> Array:
    numbers = _unmasked(name, values)
    if numbers.ndim != 1:
        raise UsageError(f"{name} has the shape {numbers.shape}: give a number each")
    _require_ids(name, numbers)
    return numbers.astype(np.uint32)


def _require_ids(name: str, column: Array) -> None:
    if column.size and column.dtype.kind not in "iu":
        raise UsageError(f"{name} has {column.dtype} values: give integers")
    if column.size and (column.min() < 0 or column.max() > 2**32 - 2):
        raise UsageError(f"{name} has values that are not 32-bit ids")
