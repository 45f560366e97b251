"""The network: nnU-Net's plain convolutional U-Net with eight stages.

Source: Isensee et al. 2021, as implemented by `dynamic-network-architectures`. nnU-Net's own planner
gives 512 x 512 images eight stages of two convolutions; the widths are what a CPU can train.
"""

import torch
from dynamic_network_architectures.architectures.unet import PlainConvUNet
from dynamic_network_architectures.initialization.weight_init import InitWeights_He
from torch import nn

STAGES = 8
#: The widest stage relative to the first; nnU-Net's plan (32..512) has 16, its cap for 2D.
WIDEST_RELATIVE_STAGE = 8
#: Every side of an input must be a multiple of this: seven halvings.
SIDE_MULTIPLE = 2 ** (STAGES - 1)
#: Index of the wire's channel in the logits; channel 0 is background.
WIRE = 1


def stage_features(width: int) -> tuple[int, ...]:
    """Channels of each stage for a first stage of `width`: doubled per stage, at most eightfold.

    >>> stage_features(16)
    (16, 32, 64, 128, 128, 128, 128, 128)
    """
    if width < 1:
        raise ValueError(f"width must be at least 1, not {width}")
    return tuple(width * min(2**stage, WIDEST_RELATIVE_STAGE) for stage in range(STAGES))


def build_network(width: int, seed: int) -> nn.Module:
    """An initialised network: (N, 1, H, W) float32 to logits (N, 2, H, W).

    The draw of the weights depends on `seed` alone; the global generator is left as it was.
    """
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        network = PlainConvUNet(
            input_channels=1,
            n_stages=STAGES,
            features_per_stage=stage_features(width),
            conv_op=nn.Conv2d,
            kernel_sizes=3,
            strides=[1] + [2] * (STAGES - 1),
            n_conv_per_stage=2,
            num_classes=2,
            n_conv_per_stage_decoder=2,
            conv_bias=True,
            norm_op=nn.InstanceNorm2d,
            norm_op_kwargs={"eps": 1e-5, "affine": True},
            nonlin=nn.LeakyReLU,
            nonlin_kwargs={"negative_slope": 0.01, "inplace": True},
            deep_supervision=False,
        )
        # Heads of deep supervision, which are built but never called without it.
        for stage in range(len(network.decoder.seg_layers) - 1):
            network.decoder.seg_layers[stage] = nn.Identity()
        # nnU-Net's initialisation; the slope is that of the leaky ReLU.
        network.apply(InitWeights_He(1e-2))
    return network


def parameter_count(network: nn.Module) -> int:
    """Number of trainable scalars."""
    return sum(parameter.numel() for parameter in network.parameters() if parameter.requires_grad)
