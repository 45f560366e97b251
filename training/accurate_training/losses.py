"""The paper's loss, L = alpha L_SkelRecall + beta L_clDice + L_CE, written from the formulas.

Probabilities P are those of the wire, (N, H, W); labels are 0/1 of the same shape. The sums run over the
whole batch: a crop without a wire then asks for no recall instead of costing a constant.
"""

from dataclasses import dataclass

import torch
import torch.nn.functional as F

from .network import WIRE
from .soft_skeleton import soft_skeleton

#: Keeps quotients of empty sums defined; added above and below where an empty sum must score 1.
EPSILON = 1.0


@dataclass(frozen=True)
class LossParams:
    """Weights of the terms; the paper has alpha = beta = 1, cross entropy 1, no Dice."""

    skeleton_recall: float = 1.0
    cl_dice: float = 1.0
    cross_entropy: float = 1.0
    dice: float = 0.0
    soft_skeleton_iterations: int = 4


@dataclass(frozen=True)
class Losses:
    """The weighted total and its terms (those with weight zero are not computed)."""

    total: torch.Tensor
    terms: dict[str, float]


def composite_loss(
    logits: torch.Tensor, mask: torch.Tensor, tube: torch.Tensor, skeleton: torch.Tensor, params: LossParams
) -> Losses:
    """The loss of logits (N, 2, H, W) against mask, tubed skeleton and skeleton, each 0/1 (N, H, W)."""
    logits = logits.float()
    probability = torch.softmax(logits, dim=1)[:, WIRE]
    terms = {
        "cross_entropy": (params.cross_entropy, lambda: F.cross_entropy(logits, mask.long())),
        "skeleton_recall": (params.skeleton_recall, lambda: skeleton_recall_loss(probability, tube)),
        "cl_dice": (
            params.cl_dice,
            lambda: cl_dice_loss(probability, mask, skeleton, params.soft_skeleton_iterations),
        ),
        "dice": (params.dice, lambda: dice_loss(probability, mask)),
    }
    values = {name: (weight, term()) for name, (weight, term) in terms.items() if weight > 0}
    if not values:
        raise ValueError("every term of the loss has weight zero")
    total = sum(weight * value for weight, value in values.values())
    return Losses(total, {name: float(value.detach()) for name, (_, value) in values.items()})


def skeleton_recall_loss(probability: torch.Tensor, tube: torch.Tensor) -> torch.Tensor:
    """1 - sum(P S_tubed) / (sum(S_tubed) + epsilon). Kirchhoff et al. 2024; equation 2 of the paper."""
    tube = tube.float()
    return 1 - (probability * tube).sum() / (tube.sum() + EPSILON)


def cl_dice_loss(
    probability: torch.Tensor, mask: torch.Tensor, skeleton: torch.Tensor, iterations: int
) -> torch.Tensor:
    """1 - 2 T_prec T_sens / (T_prec + T_sens). Shit et al. 2021; equation 3 of the paper.

    T_prec is the share of the prediction's soft skeleton that lies in the mask, T_sens the share of the
    mask's skeleton that lies in the prediction.
    """
    mask, skeleton = mask.float(), skeleton.float()
    predicted = soft_skeleton(probability, iterations)
    precision = ((predicted * mask).sum() + EPSILON) / (predicted.sum() + EPSILON)
    sensitivity = ((skeleton * probability).sum() + EPSILON) / (skeleton.sum() + EPSILON)
    return 1 - 2 * precision * sensitivity / (precision + sensitivity)


def dice_loss(probability: torch.Tensor, mask: torch.Tensor) -> torch.Tensor:
    """1 - 2 sum(P V) / (sum(P) + sum(V)), the soft Dice of nnU-Net's default loss (for the ablation)."""
    mask = mask.float()
    overlap = (probability * mask).sum()
    return 1 - (2 * overlap + EPSILON) / (probability.sum() + mask.sum() + EPSILON)
