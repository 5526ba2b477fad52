"""From checkpoints to packs: ONNX files that are checked against PyTorch, and the manifest."""
