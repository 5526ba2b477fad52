"""Training side of Troupe: from a folder of BVH files to a model pack of three ONNX stages.

The way of the data: BVH -> features (``prepare``) -> tokenizer, root module, pose module (``train``) -> ONNX
(``export``) -> figures (``evaluate``). The conventions are those of the server: right-handed, Y up, +Z forward,
metres, 30 frames a second, rotations as the first two columns of the world rotation matrix.
"""
