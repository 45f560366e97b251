"""The learning rate: a short linear rise, then nnU-Net's polynomial decay."""

#: nnU-Net's exponent.
POWER = 0.9


def learning_rate(step: int, *, steps: int, warm_up: int, peak: float) -> float:
    """Rate of step `step` of `steps`; the last step still moves (the rate is never zero)."""
    if not 0 <= step < steps:
        raise ValueError(f"step {step} of a run of {steps}")
    rise = min(1.0, (step + 1) / max(warm_up, 1))
    return peak * rise * (1 - step / steps) ** POWER
