"""Everything that a run needs to go on as if it had never stopped."""

from dataclasses import dataclass
from pathlib import Path

import torch

from .atomic import write_atomically
from .configuration import TrainConfig

FORMAT = 2


class CheckpointError(RuntimeError):
    """A checkpoint that cannot be read or does not belong to this run."""


@dataclass
class Checkpoint:
    """State after `step` steps.

    `pool_at` maps a block of `refresh_steps` steps to the number of images it draws from: batches are
    functions of (seed, step, number of images), so this is the whole position in the data.
    """

    config: TrainConfig
    step: int
    network: dict
    # The moving average of its weights, which is what leaves the run.
    ema: dict
    optimizer: dict
    pool_names: list[str]
    pool_at: dict[int, int]
    torch_rng: torch.Tensor
    # Steps of earlier runs whose weights this run began with.
    inherited_steps: int = 0

    def save(self, path: Path) -> None:
        """Writes the checkpoint whole or not at all."""
        state = {"format": FORMAT, "torch": str(torch.__version__), **vars(self), "config": self.config.to_dict()}
        write_atomically(path, lambda temporary: torch.save(state, temporary))

    @classmethod
    def load(cls, path: Path) -> "Checkpoint":
        """Reads a checkpoint; nothing in the file is executed."""
        try:
            state = torch.load(path, weights_only=True, map_location="cpu")
        except FileNotFoundError:
            raise
        except Exception as error:
            raise CheckpointError(f"{path}: not a checkpoint: {error}") from error
        if isinstance(state, dict) and state.get("format") == 1:
            # Before there was an average.
            state |= {"format": FORMAT, "ema": state.get("network")}
        if not isinstance(state, dict) or state.get("format") != FORMAT:
            found = state.get("format") if isinstance(state, dict) else type(state).__name__
            raise CheckpointError(f"{path}: format {found}, expected {FORMAT}")
        state.pop("format")
        state.pop("torch")
        state["config"] = TrainConfig.from_dict(state["config"])
        return cls(**state)
