"""The losses against their formulas, written out pixel by pixel."""

import numpy as np
import pytest
import torch
from accurate_training.losses import (
    EPSILON,
    LossParams,
    cl_dice_loss,
    composite_loss,
    dice_loss,
    skeleton_recall_loss,
)
from accurate_training.soft_skeleton import dilate, erode, soft_skeleton

# Sums of a few hundred float32 values in [0, 1] against float64: n * eps ~ 300 * 6e-8.
TOLERANCE = 2e-5


def by_neighbourhood(values: np.ndarray, choose) -> np.ndarray:
    """Minimum or maximum over the 3 x 3 neighbourhood, one pixel at a time."""
    result = np.empty_like(values)
    n, height, width = values.shape
    for image in range(n):
        for row in range(height):
            for column in range(width):
                window = values[image, max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2]
                result[image, row, column] = choose(window)
    return result


def brute_soft_skeleton(values: np.ndarray, iterations: int) -> np.ndarray:
    """Algorithm 1 of Shit et al. 2021 with loops."""
    opened = by_neighbourhood(by_neighbourhood(values, np.min), np.max)
    skeleton = np.maximum(values - opened, 0)
    for _ in range(iterations):
        values = by_neighbourhood(values, np.min)
        opened = by_neighbourhood(by_neighbourhood(values, np.min), np.max)
        skeleton = skeleton + (1 - skeleton) * np.maximum(values - opened, 0)
    return skeleton


@pytest.fixture(params=range(4))
def batch(request):
    """Probabilities and 0/1 labels (2, 9, 12) in float64."""
    rng = np.random.default_rng(request.param)
    shape = (2, 9, 12)
    return rng.random(shape), *(rng.random(shape) < 0.3 for _ in range(3))


def tensor(array: np.ndarray) -> torch.Tensor:
    return torch.from_numpy(array.astype(np.float32))


def test_morphology_equals_the_neighbourhood_loops(batch):
    values = batch[0]
    # A maximum picks one of its inputs: no rounding at all.
    assert np.array_equal(dilate(tensor(values)).numpy(), by_neighbourhood(values.astype(np.float32), np.max))
    assert np.array_equal(erode(tensor(values)).numpy(), by_neighbourhood(values.astype(np.float32), np.min))


@pytest.mark.parametrize("iterations", [0, 1, 3, 5])
def test_soft_skeleton_equals_the_algorithm(batch, iterations):
    expected = brute_soft_skeleton(batch[0], iterations)
    assert np.allclose(soft_skeleton(tensor(batch[0]), iterations).numpy(), expected, atol=TOLERANCE, rtol=0)


def test_soft_skeleton_of_a_bar_is_its_middle_line():
    bar = torch.zeros(1, 11, 30)
    bar[0, 3:8, 2:28] = 1
    skeleton = soft_skeleton(bar, 3)
    assert skeleton[0, 5, 6:24].eq(1).all()
    assert skeleton[0, [3, 4, 6, 7], 6:24].eq(0).all()


def test_too_few_iterations_leave_a_wide_body_without_skeleton():
    bar = torch.zeros(1, 15, 30)
    bar[0, 3:12, 2:28] = 1
    # Nine pixels wide: its middle row is what the fourth erosion leaves.
    assert soft_skeleton(bar, 3)[0, 7, 10:20].eq(0).all()
    assert soft_skeleton(bar, 4)[0, 7, 10:20].eq(1).all()


def test_gradient_of_a_dilation_equals_finite_differences():
    values = torch.rand(1, 5, 6, dtype=torch.float64, generator=torch.Generator().manual_seed(3), requires_grad=True)
    assert torch.autograd.gradcheck(dilate, values)
    assert torch.autograd.gradcheck(lambda v: soft_skeleton(v, 2), values)


def test_a_flat_plateau_hands_its_gradient_on_once():
    values = torch.ones(1, 4, 7, dtype=torch.float64, requires_grad=True)
    dilate(values).sum().backward()
    assert values.grad.sum() == 4 * 7


def test_skeleton_recall_loss_equals_its_formula(batch):
    probability, _, tube, _ = batch
    recalled = sum(p for p, s in zip(probability.ravel(), tube.ravel(), strict=True) if s)
    expected = 1 - recalled / (np.count_nonzero(tube) + EPSILON)
    assert skeleton_recall_loss(tensor(probability), tensor(tube)).item() == pytest.approx(expected, abs=TOLERANCE)


def test_cl_dice_loss_equals_its_formula(batch):
    probability, mask, _, skeleton = batch
    predicted = brute_soft_skeleton(probability, 3)
    precision = ((predicted * mask).sum() + EPSILON) / (predicted.sum() + EPSILON)
    sensitivity = ((skeleton * probability).sum() + EPSILON) / (skeleton.sum() + EPSILON)
    expected = 1 - 2 * precision * sensitivity / (precision + sensitivity)
    measured = cl_dice_loss(tensor(probability), tensor(mask), tensor(skeleton), 3).item()
    assert measured == pytest.approx(expected, abs=TOLERANCE)


def test_total_is_the_papers_weighted_sum(batch):
    probability, mask, tube, skeleton = batch
    logits = torch.stack([tensor(1 - probability).log(), tensor(probability).log()], dim=1)
    params = LossParams(skeleton_recall=0.5, cl_dice=2.0, soft_skeleton_iterations=3)
    losses = composite_loss(logits, tensor(mask), tensor(tube), tensor(skeleton), params)
    truth = np.where(mask, probability, 1 - probability)
    cross_entropy = -np.log(truth).mean()
    expected = (
        0.5 * skeleton_recall_loss(tensor(probability), tensor(tube)).item()
        + 2.0 * cl_dice_loss(tensor(probability), tensor(mask), tensor(skeleton), 3).item()
        + cross_entropy
    )
    # Three terms, and probabilities that went through a logarithm and a softmax.
    assert losses.total.item() == pytest.approx(expected, abs=10 * TOLERANCE)
    assert set(losses.terms) == {"cross_entropy", "skeleton_recall", "cl_dice"}


def test_a_perfect_prediction_costs_almost_nothing_and_its_inverse_almost_everything():
    mask = torch.zeros(1, 20, 40)
    mask[0, 9:12, 4:36] = 1
    skeleton = soft_skeleton(mask, 3)
    # EPSILON against sums of some 30 pixels.
    assert cl_dice_loss(mask, mask, skeleton, 3) < 1e-6
    assert skeleton_recall_loss(mask, mask) < 2 * EPSILON / mask.sum()
    assert dice_loss(mask, mask) < 1e-6
    assert cl_dice_loss(1 - mask, mask, skeleton, 3) > 0.9
    assert skeleton_recall_loss(1 - mask, mask) == 1


def test_a_crop_without_a_wire_is_finite_and_moves_only_the_other_terms():
    logits = torch.randn(1, 2, 16, 16, generator=torch.Generator().manual_seed(0), requires_grad=True)
    empty = torch.zeros(1, 16, 16)
    losses = composite_loss(logits, empty, empty, empty, LossParams())
    losses.total.backward()
    assert torch.isfinite(losses.total) and torch.isfinite(logits.grad).all()
    assert losses.terms["skeleton_recall"] == 1


def test_a_loss_without_terms_is_refused():
    with pytest.raises(ValueError, match="weight zero"):
        nothing = LossParams(skeleton_recall=0, cl_dice=0, cross_entropy=0)
        composite_loss(torch.zeros(1, 2, 4, 4), *(torch.zeros(1, 4, 4),) * 3, nothing)
