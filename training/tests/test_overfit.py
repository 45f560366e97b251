"""Smoke test: the network, the losses and the optimiser together learn one batch by heart."""

import torch
from accurate_training.augment import AugmentParams
from accurate_training.batches import draw_batch
from accurate_training.losses import LossParams, composite_loss
from accurate_training.metrics import dice
from accurate_training.network import WIRE, build_network
from accurate_training.shards import ShardPool


def test_one_batch_is_learnt_by_heart(shards):
    batch = draw_batch(ShardPool(shards), 4, seed=1, step=0, size=1, side=256, params=AugmentParams())
    labels = [torch.from_numpy(plane) for plane in (batch.mask, batch.tube, batch.skeleton)]
    network = build_network(4, 1)
    optimizer = torch.optim.AdamW(network.parameters(), lr=5e-3)
    first = None
    for _ in range(120):
        losses = composite_loss(network(torch.from_numpy(batch.image)), *labels, LossParams())
        first = first or losses.total.item()
        optimizer.zero_grad()
        losses.total.backward()
        optimizer.step()
    with torch.no_grad():
        logits = network(torch.from_numpy(batch.image))
    final = composite_loss(logits, *labels, LossParams())
    predicted = logits.argmax(dim=1)[0].numpy() == WIRE
    assert final.total.item() < 0.35 * first
    assert dice(predicted, batch.mask[0].astype(bool)) > 0.9
