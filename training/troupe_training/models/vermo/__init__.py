"""VerMo: one language model over text, motion and audio tokens, and the tokenizer of motion."""
