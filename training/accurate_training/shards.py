"""Training images on disk, mapped into memory.

`accurate synth xray --shards DIR` writes `shard-%06d.npy`: uint8, C order, shape (n, 3, H, W) with the
channels image (8 bit), mask (0/1) and tubed skeleton (0/1). Shards appear while training runs.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

IMAGE, MASK, TUBE = range(3)
PATTERN = "shard-*.npy"


class ShardError(ValueError):
    """A shard that is missing or not what the trainer was promised."""


@dataclass(frozen=True)
class Case:
    """One training image: `image` (H, W) uint8, `mask` and `tube` (H, W) of 0 and 1."""

    image: np.ndarray
    mask: np.ndarray
    tube: np.ndarray


class ShardPool:
    """The images of the shards of one or several folders, folder after folder, in the order of their file names.

    Shards are only ever appended, to the last folder: the index of an image never changes while a pool lives.
    """

    def __init__(self, *folders: Path):
        self.folders = tuple(Path(folder) for folder in folders)
        self._paths: list[Path] = []
        self._arrays: list[np.ndarray] = []
        self._ends: list[int] = []
        for folder in self.folders:
            if not folder.is_dir():
                raise ShardError(f"{folder}: no such folder of shards")
            if not any(folder.glob(PATTERN)):
                raise ShardError(f"{folder}: no {PATTERN} in it")
        self.refresh()

    def __len__(self) -> int:
        return self._ends[-1] if self._ends else 0

    @property
    def names(self) -> tuple[str, ...]:
        """Folder and file name of the shards, in order."""
        return tuple(f"{path.parent.name}/{path.name}" for path in self._paths)

    @property
    def sides(self) -> tuple[int, int]:
        """(H, W) of the images."""
        return self._arrays[0].shape[2:]

    def refresh(self) -> int:
        """Takes in shards that have appeared; the number of images.

        # Errors
        `ShardError` if a shard appeared before a known one, or if a shard is malformed.
        """
        present = [path for folder in self.folders for path in sorted(folder.glob(PATTERN))]
        for known, path in zip(self._paths, present, strict=False):
            if path != known:
                raise ShardError(f"{path}: stands where {known} stood, which would renumber images")
        for path in present[len(self._paths) :]:
            array = _open_shard(path)
            if self._arrays and array.shape[2:] != self.sides:
                raise ShardError(f"{path}: images of {array.shape[2:]}, the others have {self.sides}")
            self._paths.append(path)
            self._arrays.append(array)
            self._ends.append(len(self) + array.shape[0])
        return len(self)

    def case(self, index: int) -> Case:
        """Image number `index` (views of the mapped file, not copies)."""
        if not 0 <= index < len(self):
            raise ShardError(f"image {index} of {len(self)} in {', '.join(map(str, self.folders))}")
        shard = int(np.searchsorted(self._ends, index, side="right"))
        first = self._ends[shard] - self._arrays[shard].shape[0]
        planes = self._arrays[shard][index - first]
        for plane, what in ((MASK, "mask"), (TUBE, "tubed skeleton")):
            if planes[plane].max() > 1:
                raise ShardError(
                    f"{self._paths[shard]}: {what} of image {index - first} has the value "
                    f"{planes[plane].max()}, not only 0 and 1"
                )
        return Case(planes[IMAGE], planes[MASK], planes[TUBE])


def _open_shard(path: Path) -> np.ndarray:
    try:
        array = np.load(path, mmap_mode="r", allow_pickle=False)
    except (ValueError, OSError) as error:
        raise ShardError(f"{path}: not a readable .npy file: {error}") from error
    if array.dtype != np.uint8 or array.ndim != 4 or array.shape[1] != 3 or 0 in array.shape:
        raise ShardError(f"{path}: {array.dtype} {array.shape}, expected uint8 (n, 3, H, W)")
    return array
