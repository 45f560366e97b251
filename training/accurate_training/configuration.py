"""What a run is: everything that decides its bytes, kept in its checkpoints and in the card."""

from dataclasses import asdict, dataclass, field, fields

from .augment import AugmentParams
from .losses import LossParams

#: Seeds of the image generator; evaluation seeds are 1..999, tuning seeds 1000..1999.
TRAINING_SEED, VALIDATION_SEED, TEST_SEED = 2000, 1500, 8


@dataclass(frozen=True)
class TrainConfig:
    """One training run. The defaults are those of the shipped network, but for `steps`."""

    width: int = 16
    steps: int = 5000
    seed: int = 1
    crop_px: int = 256
    batch: int = 4
    # The last steps see whole images, as inference does.
    final_share: float = 0.1
    final_crop_px: int = 512
    final_batch: int = 2
    learning_rate: float = 2e-3
    weight_decay: float = 1e-2
    warm_up: int = 100
    # A step, of the moving average of the weights that leaves the run; 0 leaves the last ones.
    ema_decay: float = 0.0
    # nnU-Net's bound of the gradient's norm.
    gradient_norm: float = 12.0
    bfloat16: bool = True
    # Each run of this many steps looks for new shards once.
    refresh_steps: int = 50
    validate_steps: int = 250
    validation_images: int = 12
    loss: LossParams = field(default_factory=LossParams)
    augment: AugmentParams = field(default_factory=AugmentParams)

    def __post_init__(self):
        for name in ("width", "steps", "crop_px", "batch", "final_crop_px", "final_batch", "refresh_steps"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, not {getattr(self, name)}")
        if not 0 <= self.final_share <= 1:
            raise ValueError(f"final_share must lie in 0..1, not {self.final_share}")
        if not 0 <= self.ema_decay < 1:
            raise ValueError(f"ema_decay must lie in 0..1, not {self.ema_decay}")
        if not self.learning_rate > 0:
            raise ValueError(f"learning_rate must be positive, not {self.learning_rate}")

    @property
    def final_steps(self) -> int:
        """Number of steps at the final crop size."""
        return round(self.steps * self.final_share)

    def crop_at(self, step: int) -> tuple[int, int]:
        """(batch size, side of the crops) of a step."""
        if step >= self.steps - self.final_steps:
            return self.final_batch, self.final_crop_px
        return self.batch, self.crop_px

    def to_dict(self) -> dict:
        """Plain values, for checkpoints and cards."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: dict) -> "TrainConfig":
        """The inverse of `to_dict`; an unknown key is an error."""
        values = dict(values)
        values["loss"] = LossParams(**values["loss"])
        augment = dict(values["augment"])
        for name in ("gamma", "contrast", "blur_sigma_px"):
            augment[name] = tuple(augment[name])
        values["augment"] = AugmentParams(**augment)
        unknown = set(values) - {known.name for known in fields(cls)}
        if unknown:
            raise ValueError(f"unknown settings {sorted(unknown)}")
        return cls(**values)
