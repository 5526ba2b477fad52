"""Training: the loop that all networks share, checkpoints and curves; a folder for each family of models."""
