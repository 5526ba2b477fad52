"""Training of VerMo."""
