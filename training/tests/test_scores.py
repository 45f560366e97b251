"""The scores: by hand, by brute force, and their table."""

import json

import numpy as np
import pytest
from accurate_training.__main__ import main
from accurate_training.evaluate import bootstrap, markdown_table, onnx_segmenter, score_method
from accurate_training.export import export_onnx
from accurate_training.filters import tune_filter
from accurate_training.metrics import centreline_distance, near_share, score_mask
from accurate_training.network import build_network
from accurate_training.predict import wire_probability
from accurate_training.shards import ShardPool
from skimage.morphology import skeletonize


def bar(rows, columns, shape=(40, 60)):
    mask = np.zeros(shape, bool)
    mask[rows, columns] = True
    return mask


def test_the_truth_scores_perfectly_against_itself():
    truth = bar(slice(18, 21), slice(5, 55))
    scores = score_mask(truth, truth)
    assert scores.dice == 1 and scores.cl_dice == 1 and scores.betti0_error == 0
    assert scores.centreline_distance_px == 0
    assert set(scores.skeleton_recall.values()) | set(scores.skeleton_precision.values()) == {1.0}


def test_a_shifted_line_is_recalled_at_its_shift_and_not_before():
    truth, shifted = bar(20, slice(5, 55)), bar(22, slice(5, 55))
    scores = score_mask(shifted, truth)
    assert scores.skeleton_recall == {1: 0.0, 2: 1.0, 3: 1.0}
    assert scores.centreline_distance_px == 2
    assert scores.cl_dice == 0 and scores.dice == 0


def test_half_a_line_has_half_the_recall_and_all_the_precision():
    scores = score_mask(bar(20, slice(5, 30)), bar(20, slice(5, 55)))
    # 25 of 50 pixels, and one beyond the tip is within 1 px.
    assert scores.skeleton_recall[1] == pytest.approx(26 / 50)
    assert scores.skeleton_precision[1] == 1


def test_a_line_in_three_pieces_has_two_components_too_many():
    broken = bar(20, slice(5, 55))
    broken[20, [15, 16, 35, 36]] = False
    assert score_mask(broken, bar(20, slice(5, 55))).betti0_error == 2


def test_an_empty_prediction_is_a_failure_not_a_zero():
    scores = score_mask(np.zeros((40, 60), bool), bar(20, slice(5, 55)))
    assert scores.failed and scores.cl_dice is None and scores.skeleton_precision[2] is None
    assert scores.skeleton_recall[2] == 0
    with pytest.raises(ValueError, match="no wire"):
        score_mask(bar(20, slice(5, 55)), np.zeros((40, 60), bool))


@pytest.mark.parametrize("seed", range(5))
def test_distances_equal_brute_force(seed):
    rng = np.random.default_rng(seed)
    a, b = (skeletonize(rng.random((24, 24)) < 0.5) for _ in range(2))
    pa, pb = (np.argwhere(plane) for plane in (a, b))
    gaps = np.sqrt(((pa[:, None] - pb[None]) ** 2).sum(axis=2))
    for tolerance in (1, 2, 3):
        assert near_share(a, b, tolerance) == pytest.approx((gaps.min(axis=1) <= tolerance).mean(), abs=1e-12)
    expected = (gaps.min(axis=1).mean() + gaps.min(axis=0).mean()) / 2
    assert centreline_distance(a, b) == pytest.approx(expected, abs=1e-12)


def test_the_bootstrap_leaves_undefined_scores_out_and_repeats_itself():
    values = [0.9, None, 0.7, 0.8, 1.0]
    estimate = bootstrap(values)
    assert estimate == bootstrap(values)
    assert estimate.mean == pytest.approx(0.85) and estimate.defined == 4
    assert 0.7 <= estimate.low < estimate.mean < estimate.high <= 1.0
    assert bootstrap([None, None]) is None


def test_the_exported_file_segments_like_the_network(shards, tmp_path):
    network = build_network(2, 1).eval()
    export_onnx(network, tmp_path / "net.onnx", half_weights=False, metadata={})
    image = ShardPool(shards).case(0).image[:200, :250]
    probability = wire_probability(network, image, bfloat16=False)
    mask = onnx_segmenter(tmp_path / "net.onnx")(image)
    assert mask.shape == probability.shape == (200, 250)
    # Away from the threshold by more than the engines differ.
    clear = np.abs(probability - 0.5) > 1e-3
    assert clear.mean() > 0.5 and np.array_equal(mask[clear], probability[clear] >= 0.5)


def test_a_ridge_filter_finds_an_easy_wire(shards):
    pool = ShardPool(shards)
    cases = [pool.case(index) for index in range(len(pool))]
    chosen = tune_filter("Sato", [case.image for case in cases[:2]], [case.mask for case in cases[:2]])
    scores = score_method(chosen.mask, [case.image for case in cases[2:]], [case.mask for case in cases[2:]])
    assert np.mean([score.skeleton_recall[2] for score in scores]) > 0.7


def test_the_command_prints_a_row_per_method_and_writes_every_image(shards, tmp_path, capsys):
    export_onnx(build_network(2, 1), tmp_path / "net.onnx", half_weights=True, metadata={})
    out = tmp_path / "scores.json"
    assert main([
        "evaluate", "--shards", str(shards), "--count", "3", "--model", f"random={tmp_path / 'net.onnx'}",
        "--tuning", str(shards), "--tuning-count", "1", "--output", str(out),
    ]) == 0
    rows = capsys.readouterr().out.splitlines()
    assert [row.split("|")[1].strip() for row in rows] == ["method", "---", "random", "Frangi", "Sato"]
    document = json.loads(out.read_text())
    assert len(document["methods"]["Sato"]["images"]) == 3
    assert main(["evaluate", "--shards", str(shards), "--count", "5"]) == 2
    assert "4 images with a wire, 5 wanted" in capsys.readouterr().err


def test_undefined_cells_say_so():
    empty = score_mask(np.zeros((40, 60), bool), bar(20, slice(5, 55)))
    assert "undefined" in markdown_table({"nothing": [empty]}, ["clDice"])
