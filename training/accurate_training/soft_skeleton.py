"""The differentiable skeleton of Shit et al. 2021 (Algorithm 1), written from the paper.

Morphology of grey values with a 3 x 3 neighbourhood: an erosion is a minimum, a dilation a maximum.
What an erosion leaves that an opening would remove belongs to the skeleton:

    S_0 = relu(V_0 - open(V_0)),  V_k = erode(V_{k-1}),
    S_k = S_{k-1} + (1 - S_{k-1}) * relu(V_k - open(V_k)).

`iterations` erosions peel bodies of a width up to 2 * iterations + 1 pixels.
"""

import torch
import torch.nn.functional as F


def soft_skeleton(probability: torch.Tensor, iterations: int) -> torch.Tensor:
    """The soft skeleton of (N, H, W) values in [0, 1]; the same shape, values in [0, 1]."""
    if iterations < 0:
        raise ValueError(f"iterations must not be negative, got {iterations}")
    body = probability
    skeleton = None
    for _ in range(iterations + 1):
        eroded = erode(body)
        ridge = F.relu(body - dilate(eroded))
        skeleton = ridge if skeleton is None else skeleton + (1 - skeleton) * ridge
        body = eroded
    return skeleton


def dilate(values: torch.Tensor) -> torch.Tensor:
    """Maximum over the 3 x 3 neighbourhood inside the image."""
    return _Spread.apply(_Spread.apply(values, 1), 2)


def erode(values: torch.Tensor) -> torch.Tensor:
    """Minimum over the 3 x 3 neighbourhood inside the image."""
    return -dilate(-values)


class _Spread(torch.autograd.Function):
    """Maximum of each value and its two neighbours along one axis.

    Two of these make a 3 x 3 maximum, several times faster on a CPU than a pooling of one channel. The
    gradient goes to one maximal value: the middle one if it is maximal, else the one before, else the
    one behind.
    """

    @staticmethod
    def forward(context, values: torch.Tensor, axis: int) -> torch.Tensor:
        spread = values.clone()
        behind, before = _all_but_first(spread, axis), _all_but_last(spread, axis)
        torch.maximum(behind, _all_but_last(values, axis), out=behind)
        torch.maximum(before, _all_but_first(values, axis), out=before)
        context.save_for_backward(values, spread)
        context.axis = axis
        return spread

    @staticmethod
    def backward(context, gradient: torch.Tensor) -> tuple[torch.Tensor, None]:
        values, spread = context.saved_tensors
        axis = context.axis
        received = gradient * (values == spread)
        rest = gradient - received
        first_wins = _all_but_last(values, axis) == _all_but_first(spread, axis)
        to_before = _all_but_first(rest, axis) * first_wins
        _all_but_last(received, axis).add_(to_before)
        _all_but_first(rest, axis).sub_(to_before)
        _all_but_first(received, axis).add_(_all_but_last(rest, axis))
        return received, None


def _all_but_first(values: torch.Tensor, axis: int) -> torch.Tensor:
    return values.narrow(axis, 1, values.shape[axis] - 1)


def _all_but_last(values: torch.Tensor, axis: int) -> torch.Tensor:
    return values.narrow(axis, 0, values.shape[axis] - 1)
