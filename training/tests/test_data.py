"""Shards, crops, grey values."""

import numpy as np
import pytest
from accurate_training.augment import AugmentParams, bend_greys, enlarge, turn
from accurate_training.batches import draw_batch
from accurate_training.normalise import STD_FLOOR, z_score
from accurate_training.shards import ShardError, ShardPool
from skimage import measure

from tests.conftest import write_shard


def batch_of(pool, step, **changes):
    settings = {"seed": 1, "size": 3, "side": 128, "params": AugmentParams()} | changes
    return draw_batch(pool, len(pool), step=step, **settings)


def test_a_batch_is_a_function_of_seed_and_step(shards):
    pool = ShardPool(shards)
    again = [vars(batch_of(ShardPool(shards), 5)) for _ in range(2)]
    assert all(np.array_equal(again[0][name], again[1][name]) for name in again[0])
    assert not np.array_equal(batch_of(pool, 5).image, batch_of(pool, 6).image)
    assert not np.array_equal(batch_of(pool, 5).image, batch_of(pool, 5, seed=2).image)


@pytest.mark.parametrize("step", range(6))
def test_labels_stay_labels_and_the_skeleton_lies_in_mask_and_tube(shards, step):
    batch = batch_of(ShardPool(shards), step, params=AugmentParams(zoom_probability=1.0))
    for plane in (batch.mask, batch.tube, batch.skeleton):
        assert plane.dtype == np.uint8 and plane.shape == (3, 128, 128) and set(np.unique(plane)) <= {0, 1}
    assert batch.image.dtype == np.float32 and batch.image.shape == (3, 1, 128, 128)
    assert np.isfinite(batch.image).all()
    assert not (batch.skeleton & ~batch.mask & 1).any()
    assert not (batch.tube & ~batch.mask & 1).any()
    # The tube reaches 2 px from the skeleton of the whole image; cutting and enlarging move the
    # skeleton of a crop by a pixel or two, and by half a wire's width at the rim.
    inner = np.s_[:, 8:-8, 8:-8]
    astray = (batch.skeleton[inner] & ~batch.tube[inner] & 1).sum()
    assert astray <= 0.02 * max(batch.skeleton.sum(), 1)


def test_two_thirds_of_the_crops_are_centred_on_the_wire(shards):
    pool = ShardPool(shards)
    params = AugmentParams(zoom_probability=0.0, polarity_probability=0.0)
    centred = 0
    draws = 300
    for step in range(draws):
        mask = batch_of(pool, step, size=1, side=32, params=params).mask[0]
        centred += mask[15:17, 15:17].any()
    # Of 300 draws at 2/3: 200 +- 8; four standard deviations, and some of the others hit by chance.
    assert 167 <= centred <= 250


def test_turning_keeps_image_and_label_together():
    rng = np.random.default_rng(0)
    plane = rng.random((7, 7))
    seen = set()
    for _ in range(200):
        a, b = turn([plane, plane * 2], rng)
        assert np.array_equal(a * 2, b)
        seen.add(a.tobytes())
    assert len(seen) == 8


@pytest.mark.parametrize("radius", [0.5, 0.6, 0.75, 1.5])
def test_enlarging_keeps_lines_of_any_slope_in_as_many_pieces(radius):
    rng = np.random.default_rng(3)
    rows, columns = np.mgrid[:80, :80]
    for _ in range(60):
        angle, side = rng.uniform(0, np.pi), int(rng.integers(81, 113))
        across = (columns - 39.7) * np.sin(angle) - (rows - 40.2) * np.cos(angle)
        line = (np.abs(across) <= radius).astype(np.uint8)
        larger = enlarge(line, side, label=True)
        assert larger.shape == (side, side) and larger.dtype == np.uint8
        pieces = [measure.label(plane, connectivity=2).max() for plane in (line, larger)]
        assert pieces[0] == pieces[1] >= 1
        # As much wider as the plane: every pixel stands for its share of the area.
        assert larger.mean() == pytest.approx(line.mean(), rel=0.15)


def test_bent_greys_are_finite_for_a_flat_image():
    params = AugmentParams(gamma_probability=1, contrast_probability=1, blur_probability=1)
    assert np.isfinite(bend_greys(np.zeros((16, 16), np.float32), np.random.default_rng(0), params)).all()


def test_z_score_has_mean_zero_and_deviation_one_and_survives_a_flat_image():
    grey = np.random.default_rng(1).integers(0, 255, (64, 64)).astype(np.uint8)
    scored = z_score(grey)
    # 4096 float32 values: rounding of the mean is below 1e-6.
    assert abs(scored.mean()) < 1e-5 and abs(scored.std() - 1) < 1e-5
    assert np.array_equal(z_score(np.full((8, 8), 77, np.uint8)), np.zeros((8, 8), np.float32))
    assert STD_FLOOR > 0


def test_images_are_numbered_across_shards(tmp_path):
    for number, count in enumerate([2, 3, 1]):
        write_shard(tmp_path, number, count=count, side=64)
    pool = ShardPool(tmp_path)
    assert len(pool) == 6
    stored = np.load(tmp_path / "shard-000001.npy")
    assert np.array_equal(pool.case(4).image, stored[2, 0])
    assert np.array_equal(pool.case(4).mask, stored[2, 1])
    with pytest.raises(ShardError, match="image 6 of 6"):
        pool.case(6)


def test_several_folders_follow_one_another_and_only_the_last_may_grow(tmp_path):
    first, second = tmp_path / "first", tmp_path / "second"
    write_shard(first, 0, count=2, side=64)
    write_shard(second, 0, count=3, side=64)
    pool = ShardPool(first, second)
    assert pool.names == ("first/shard-000000.npy", "second/shard-000000.npy")
    assert np.array_equal(pool.case(2).image, np.load(second / "shard-000000.npy")[0, 0])
    write_shard(second, 1, count=1, side=64)
    assert pool.refresh() == 6
    write_shard(first, 1, count=1, side=64)
    with pytest.raises(ShardError, match="renumber"):
        pool.refresh()


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (np.zeros((2, 3, 8, 8), np.float32), "float32"),
        (np.zeros((2, 2, 8, 8), np.uint8), r"\(2, 2, 8, 8\)"),
        (np.zeros((0, 3, 8, 8), np.uint8), r"\(0, 3, 8, 8\)"),
    ],
)
def test_malformed_shards_are_refused(tmp_path, array, message):
    np.save(tmp_path / "shard-000000.npy", array)
    with pytest.raises(ShardError, match=message):
        ShardPool(tmp_path)


def test_torn_absent_and_mislabelled_shards_are_refused(tmp_path):
    with pytest.raises(ShardError, match="no shard"):
        ShardPool(tmp_path)
    with pytest.raises(ShardError, match="no such folder"):
        ShardPool(tmp_path / "nowhere")
    write_shard(tmp_path, 0, count=1, side=64)
    whole = (tmp_path / "shard-000000.npy").read_bytes()
    (tmp_path / "shard-000000.npy").write_bytes(whole[:200])
    with pytest.raises(ShardError, match="not a readable"):
        ShardPool(tmp_path)
    array = np.zeros((1, 3, 8, 8), np.uint8)
    array[0, 1, 2, 2] = 255
    np.save(tmp_path / "shard-000000.npy", array)
    with pytest.raises(ShardError, match="mask of image 0 has the value 255"):
        ShardPool(tmp_path).case(0)


def test_a_shard_that_would_renumber_images_is_refused(tmp_path):
    write_shard(tmp_path, 5, count=1, side=64)
    pool = ShardPool(tmp_path)
    write_shard(tmp_path, 2, count=1, side=64)
    with pytest.raises(ShardError, match="renumber"):
        pool.refresh()


def test_a_crop_larger_than_the_image_is_refused(shards):
    with pytest.raises(ShardError, match="crop of 300 px does not fit"):
        batch_of(ShardPool(shards), 0, side=300)
