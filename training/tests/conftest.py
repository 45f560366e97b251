"""Small shards drawn with numpy, so that the tests need no generator."""

from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.ndimage import distance_transform_edt, gaussian_filter
from skimage.morphology import skeletonize


def draw_case(rng: np.random.Generator, side: int) -> np.ndarray:
    """Image, mask and tubed skeleton (3, side, side) of one dark wire on a cloudy ground."""
    t = np.linspace(0, 1, 8 * side)
    reach = 0.4 * side
    x = side / 2 + reach * np.sin(2 * np.pi * (t * rng.uniform(0.4, 1.2) + rng.random()))
    y = side / 2 + reach * np.sin(2 * np.pi * (t * rng.uniform(0.4, 1.2) + rng.random()))
    centre = np.zeros((side, side), bool)
    centre[y.astype(int), x.astype(int)] = True
    mask = distance_transform_edt(~centre) <= rng.uniform(0.8, 2.5)
    tube = distance_transform_edt(~skeletonize(mask)) <= 2
    cloud = gaussian_filter(rng.standard_normal((side, side)), side / 16)
    grey = 130 + 20 * cloud / cloud.std() - 50 * mask + rng.normal(0, 6, (side, side))
    return np.stack([gaussian_filter(grey, 0.6).clip(0, 255).astype(np.uint8), mask, tube])


def write_shard(folder: Path, number: int, *, count: int, side: int) -> None:
    """Writes `shard-<number>.npy`."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng([9, number])
    np.save(
        folder / f"shard-{number:06}.npy", np.stack([draw_case(rng, side) for _ in range(count)]).astype(np.uint8)
    )


@pytest.fixture
def shards(tmp_path: Path) -> Path:
    """A folder with one shard of four images of 272 x 272."""
    write_shard(tmp_path / "shards", 0, count=4, side=272)
    return tmp_path / "shards"


@pytest.fixture(autouse=True)
def one_thread():
    """Bytes are promised for one thread."""
    torch.set_num_threads(1)
