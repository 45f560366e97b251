"""Files that the Rust side reads or writes."""

import json
from pathlib import Path

import numpy as np
import onnxruntime
import pytest
import torch
from accurate_training.fixture import fixture_image, write_fixture
from accurate_training.losses import dice_loss
from accurate_training.metrics import cl_dice, dice, near_share
from accurate_training.normalise import z_score

REPOSITORY = Path(__file__).parents[2]
RUST_SCORES = REPOSITORY / "crates/accurate-eval/tests/fixtures/masks.json"
FIXTURE = REPOSITORY / "training/fixtures"


def test_scores_are_those_of_the_rust_side():
    if not RUST_SCORES.exists():
        pytest.skip(f"{RUST_SCORES} is not there")
    cases = json.loads(RUST_SCORES.read_text())["cases"]
    assert cases
    for case in cases:
        truth, predicted, true_skeleton, skeleton = (
            np.array(case[name], bool) for name in ("truth", "predicted", "truth_skeleton", "predicted_skeleton")
        )
        if case["dice"] is not None:
            assert dice(predicted, truth) == pytest.approx(case["dice"], abs=1e-12)
        if case["cl_dice"] is not None:
            assert cl_dice(predicted, skeleton, truth, true_skeleton) == pytest.approx(case["cl_dice"], abs=1e-12)
        for tolerance, expected in case["skeleton_recall"].items():
            if expected is not None:
                assert near_share(true_skeleton, skeleton, float(tolerance)) == pytest.approx(expected, abs=1e-12)
        for tolerance, expected in case["skeleton_precision"].items():
            if expected is not None:
                assert near_share(skeleton, true_skeleton, float(tolerance)) == pytest.approx(expected, abs=1e-12)


def test_the_committed_fixture_is_what_the_package_makes(tmp_path):
    write_fixture(tmp_path)
    assert np.array_equal(np.load(FIXTURE / "tsn-tiny-image.npy"), fixture_image())
    ours, committed = (np.load(folder / "tsn-tiny-margin.npy") for folder in (tmp_path, FIXTURE))
    # Half precision of values around 1, and another machine's convolutions.
    assert np.abs(ours.astype(np.float32) - committed).max() < 4e-3
    assert sum(path.stat().st_size for path in FIXTURE.iterdir()) <= 200_000


def test_onnx_runtime_repeats_the_fixture():
    session = onnxruntime.InferenceSession(str(FIXTURE / "tsn-tiny.onnx"), providers=["CPUExecutionProvider"])
    image = z_score(np.load(FIXTURE / "tsn-tiny-image.npy"))[None, None]
    (logits,) = session.run(None, {"image": image})
    expected = np.load(FIXTURE / "tsn-tiny-margin.npy").astype(np.float32)
    # The margin was rounded to float16: half a unit of 2^-10 relative, values up to a few.
    assert np.abs(logits[0, 1] - logits[0, 0] - expected).max() < 2e-3 * max(1, np.abs(expected).max())


def test_soft_dice_counts_a_hard_mask_as_dice_does():
    rng = np.random.default_rng(2)
    predicted, truth = (rng.random((1, 30, 30)) < 0.4 for _ in range(2))
    soft = 1 - dice_loss(torch.from_numpy(predicted).float(), torch.from_numpy(truth)).item()
    # EPSILON above and below sums of about 700.
    assert soft == pytest.approx(dice(predicted, truth), abs=2e-3)
