"""Networks, without training and without files; a folder for each family of models."""
