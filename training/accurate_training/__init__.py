"""Training of the topology-aware segmentation network (TSN).

The package gives the Rust side files, never code: an ONNX network, its card, and parity fixtures.
"""
