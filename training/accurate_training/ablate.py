"""Does topology pay? The same short run with different losses, on the same crops in the same order."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from .augment import AugmentParams
from .checkpoint import Checkpoint
from .configuration import TrainConfig
from .evaluate import held_out, score_method
from .losses import LossParams
from .metrics import MaskScores
from .network import build_network
from .predict import THRESHOLD, wire_probability
from .trainer import CHECKPOINT, Trainer, TrainingError

#: Cross entropy stays in every arm; nnU-Net's default loss (cross entropy + Dice) is the ground line.
ARMS: dict[str, LossParams] = {
    "CE + Dice": LossParams(skeleton_recall=0, cl_dice=0, dice=1),
    "CE + Dice + clDice": LossParams(skeleton_recall=0, cl_dice=1, dice=1),
    "CE + Dice + skeleton recall": LossParams(skeleton_recall=1, cl_dice=0, dice=1),
    "CE + Dice + clDice + skeleton recall": LossParams(skeleton_recall=1, cl_dice=1, dice=1),
}


def ablation_config(loss: LossParams, *, width: int, steps: int, crop_px: int) -> TrainConfig:
    """One arm: everything but the loss is shared; no final phase, so that no arm profits from it."""
    return replace(
        TrainConfig(width=width, steps=steps, crop_px=crop_px, final_share=0.0, validate_steps=steps + 1),
        loss=loss,
        augment=AugmentParams(),
    )


def run_ablation(
    arms: list[str], *, shards: Path, test: Path, folder: Path, count: int, width: int, steps: int, crop_px: int
) -> dict[str, list[MaskScores]]:
    """Trains every named arm in `folder` (resuming what is there) and scores it on `count` images.

    The shards must be complete before the first arm begins: arms are only comparable on the same images.
    """
    images, masks = held_out(test, count)
    results = {}
    for name in arms:
        config = ablation_config(ARMS[name], width=width, steps=steps, crop_px=crop_px)
        run = folder / folder_name(name)
        reached = Trainer(config, shards=[shards], run=run).train()
        if reached < steps:
            raise TrainingError(f"{run}: stopped at step {reached} of {steps}; the same command goes on")
        results[name] = score_method(checkpoint_segmenter(run / CHECKPOINT), images, masks)
    return results


def folder_name(arm: str) -> str:
    """The folder of an arm's run."""
    return "".join(letter if letter.isalnum() else "-" for letter in arm.lower()).strip("-")


def checkpoint_segmenter(path: Path) -> Callable[[np.ndarray], np.ndarray]:
    """Image to mask with the weights of a checkpoint, in float32."""
    checkpoint = Checkpoint.load(path)
    network = build_network(checkpoint.config.width, checkpoint.config.seed)
    network.load_state_dict(checkpoint.ema)
    network.eval()
    return lambda image: wire_probability(network, image, bfloat16=False) >= THRESHOLD
