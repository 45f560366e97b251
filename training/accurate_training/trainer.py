"""The training loop: deterministic, resumable at any step, never waiting for data."""

import signal
import sys
import time
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import numpy as np
import torch
from torch import nn

from .batches import Batch, draw_batch
from .checkpoint import Checkpoint, CheckpointError
from .configuration import TrainConfig
from .curves import Curve
from .import_weights import load_onnx_weights
from .losses import composite_loss
from .metrics import score_mask
from .network import build_network
from .predict import THRESHOLD, wire_probability
from .moving_average import MovingAverage
from .schedule import learning_rate
from .shards import ShardError, ShardPool

CHECKPOINT = "checkpoint.pt"
STEP_CURVE, VALIDATION_CURVE = "steps.csv", "validation.csv"
#: Batches that are drawn ahead of the step that uses them.
AHEAD = 3


class TrainingError(RuntimeError):
    """A run that cannot go on."""


class Trainer:
    """One run in one folder; a folder that holds a checkpoint is resumed."""

    def __init__(
        self,
        config: TrainConfig,
        *,
        shards: Sequence[Path],
        run: Path,
        validation: Path | None = None,
        init_from: Path | None = None,
    ):
        """`shards` are folders whose images are drawn alike. `init_from` is a checkpoint or an exported network
        whose weights (only those) start a new run."""
        self.config, self.run_folder = config, Path(run)
        self.pool = ShardPool(*shards)
        self.validation = _validation_cases(validation, config.validation_images)
        self.network = build_network(config.width, config.seed)
        self.step, self.pool_at, self.inherited_steps = 0, {}, 0
        checkpoint = self._own_checkpoint()
        if checkpoint is None and init_from is not None:
            self._inherit(init_from)
        # channels_last is the layout that oneDNN's convolutions want.
        self.network.to(memory_format=torch.channels_last)
        self.optimizer = torch.optim.AdamW(
            self.network.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay
        )
        # What is validated and exported; a network of its own, since the other one goes on learning.
        self.ema = MovingAverage(self.network, config.ema_decay)
        if checkpoint is not None:
            self._restore(checkpoint)
        self._stop_asked = False

    def train(self, *, until: int | None = None, checkpoint_seconds: float = 180.0) -> int:
        """Trains up to step `until` (the end if None) and writes a checkpoint; the step reached.

        SIGTERM and SIGINT end the run after the current step, with a checkpoint.
        """
        until = self.config.steps if until is None else min(until, self.config.steps)
        self.run_folder.mkdir(parents=True, exist_ok=True)
        steps_curve = Curve(
            self.run_folder / STEP_CURVE,
            ["loss", "cross_entropy", "skeleton_recall", "cl_dice", "dice", "rate", "gradient", "images", "seconds"],
            before_step=self.step,
        )
        validation_curve = Curve(
            self.run_folder / VALIDATION_CURVE,
            ["dice", "cl_dice", "recall_2px", "precision_2px", "distance_px", "betti0_error", "failures"],
            before_step=self.step + 1,
        )
        handlers = {which: signal.signal(which, self._ask_stop) for which in (signal.SIGTERM, signal.SIGINT)}
        saved = time.monotonic()
        try:
            with ThreadPoolExecutor(max_workers=1) as drawing:
                batches: dict[int, Future[Batch]] = {}
                while self.step < until and not self._stop_asked:
                    for ahead in range(self.step, min(self.step + AHEAD, until)):
                        if ahead not in batches:
                            batches[ahead] = drawing.submit(self._draw, ahead, self._images_at(ahead))
                    began = time.monotonic()
                    row = self._learn(batches.pop(self.step).result())
                    steps_curve.append(step=self.step, **row, seconds=time.monotonic() - began)
                    self.step += 1
                    self.ema.update(self.network, self.step)
                    if self.step % self.config.validate_steps == 0 or self.step == self.config.steps:
                        self._validate(validation_curve)
                    if time.monotonic() - saved > checkpoint_seconds:
                        self.save()
                        saved = time.monotonic()
        finally:
            for which, handler in handlers.items():
                signal.signal(which, handler)
        self.save()
        return self.step

    def save(self) -> None:
        """Writes the checkpoint of the run."""
        Checkpoint(
            config=self.config,
            step=self.step,
            network=self.network.state_dict(),
            ema=self.ema.weights,
            optimizer=self.optimizer.state_dict(),
            pool_names=list(self.pool.names),
            pool_at=dict(self.pool_at),
            torch_rng=torch.get_rng_state(),
            inherited_steps=self.inherited_steps,
        ).save(self.run_folder / CHECKPOINT)

    def _learn(self, batch: Batch) -> dict[str, float]:
        config = self.config
        rate = learning_rate(self.step, steps=config.steps, warm_up=config.warm_up, peak=config.learning_rate)
        for group in self.optimizer.param_groups:
            group["lr"] = rate
        self.network.train()
        image = torch.from_numpy(batch.image).contiguous(memory_format=torch.channels_last)
        with torch.autocast("cpu", torch.bfloat16, enabled=config.bfloat16):
            logits = self.network(image)
        losses = composite_loss(
            logits, *(torch.from_numpy(plane) for plane in (batch.mask, batch.tube, batch.skeleton)), config.loss
        )
        self.optimizer.zero_grad(set_to_none=True)
        losses.total.backward()
        gradient = float(nn.utils.clip_grad_norm_(self.network.parameters(), config.gradient_norm))
        if not np.isfinite([float(losses.total.detach()), gradient]).all():
            raise TrainingError(f"step {self.step}: loss {float(losses.total.detach())}, gradient norm {gradient}")
        self.optimizer.step()
        loss = float(losses.total.detach())
        images = self.pool_at[self.step // config.refresh_steps]
        return {"loss": loss, **losses.terms, "rate": rate, "gradient": gradient, "images": images}

    def _draw(self, step: int, images: int) -> Batch:
        size, side = self.config.crop_at(step)
        return draw_batch(
            self.pool, images, seed=self.config.seed, step=step, size=size, side=side, params=self.config.augment
        )

    def _images_at(self, step: int) -> int:
        block = step // self.config.refresh_steps
        if block not in self.pool_at:
            self.pool_at[block] = self.pool.refresh()
        return self.pool_at[block]

    def _validate(self, curve: Curve) -> None:
        if not self.validation:
            return
        network = build_network(self.config.width, self.config.seed)
        network.load_state_dict(self.ema.weights)
        network.to(memory_format=torch.channels_last).eval()
        scores = [
            score_mask(wire_probability(network, image, bfloat16=self.config.bfloat16) >= THRESHOLD, mask)
            for image, mask in self.validation
        ]
        found = [score for score in scores if not score.failed]
        row = {"dice": np.mean([score.dice for score in scores]), "failures": len(scores) - len(found)}
        row["recall_2px"] = np.mean([score.skeleton_recall[2] for score in scores])
        row["betti0_error"] = np.mean([score.betti0_error for score in scores])
        if found:
            row["cl_dice"] = np.mean([score.cl_dice for score in found])
            row["precision_2px"] = np.mean([score.skeleton_precision[2] for score in found])
            row["distance_px"] = np.mean([score.centreline_distance_px for score in found])
        curve.append(step=self.step, **row)
        figures = ", ".join(f"{name} {float(value):.3f}" for name, value in row.items())
        print(f"step {self.step}/{self.config.steps}: {figures}", file=sys.stderr, flush=True)

    def _own_checkpoint(self) -> Checkpoint | None:
        path = self.run_folder / CHECKPOINT
        if not path.exists():
            return None
        checkpoint = Checkpoint.load(path)
        # Only the length may differ: a longer or shorter decay is a choice made while a run is under way.
        mine, theirs = self.config.to_dict(), checkpoint.config.to_dict()
        differing = [name for name in mine if name != "steps" and mine[name] != theirs[name]]
        if differing:
            changes = ", ".join(f"{name}: {theirs[name]} there, {mine[name]} here" for name in differing)
            raise CheckpointError(f"{path} belongs to another run ({changes})")
        return checkpoint

    def _restore(self, checkpoint: Checkpoint) -> None:
        present = self.pool.names[: len(checkpoint.pool_names)]
        if list(present) != checkpoint.pool_names:
            raise ShardError(
                f"the run has drawn from {len(checkpoint.pool_names)} shards, and they are no longer "
                f"the first ones in {', '.join(map(str, self.pool.folders))}"
            )
        self.network.load_state_dict(checkpoint.network)
        self.ema.weights = checkpoint.ema
        self.optimizer.load_state_dict(checkpoint.optimizer)
        torch.set_rng_state(checkpoint.torch_rng)
        self.step, self.pool_at = checkpoint.step, dict(checkpoint.pool_at)
        self.inherited_steps = checkpoint.inherited_steps

    def _inherit(self, path: Path) -> None:
        if path.suffix == ".onnx":
            self.inherited_steps = load_onnx_weights(self.network, path)
            return
        other = Checkpoint.load(path)
        if other.config.width != self.config.width:
            raise CheckpointError(f"weights of width {other.config.width} do not fit width {self.config.width}")
        self.network.load_state_dict(other.ema)
        self.inherited_steps = other.inherited_steps + other.step

    def _ask_stop(self, *_: object) -> None:
        self._stop_asked = True


def _validation_cases(folder: Path | None, count: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Image and mask of the first `count` images that have a wire."""
    if folder is None:
        return []
    pool, chosen = ShardPool(folder), []
    for index in range(len(pool)):
        if len(chosen) == count:
            break
        case = pool.case(index)
        if case.mask.any():
            chosen.append((np.array(case.image), np.array(case.mask)))
    if not chosen:
        raise ShardError(f"{folder}: no image with a wire")
    return chosen
