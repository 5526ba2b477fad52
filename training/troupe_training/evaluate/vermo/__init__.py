"""VerMo without a server: reconstruction, texts, continuations, and what they are compared with."""
