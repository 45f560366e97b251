"""The exponential moving average (EMA) of a network's weights along its training."""

import torch
from torch import nn


class MovingAverage:
    """`average <- d average + (1 - d) weights` after every step, d rising to `decay` from a start without memory.

    With a decay of 0 it is the network itself. (Polyak and Juditsky 1992; the rise is that of TensorFlow's
    `ExponentialMovingAverage`, so that the weights of the start are soon forgotten.)
    """

    def __init__(self, network: nn.Module, decay: float):
        self.decay = decay
        self.weights = {name: value.detach().clone() for name, value in network.state_dict().items()}

    @torch.no_grad()
    def update(self, network: nn.Module, step: int) -> None:
        """Takes in the weights after `step` steps (counted from 1)."""
        decay = min(self.decay, step / (step + 9))
        for name, value in network.state_dict().items():
            average = self.weights[name]
            if average.is_floating_point():
                average.lerp_(value, 1.0 - decay)
            else:
                average.copy_(value)
