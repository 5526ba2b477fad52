"""UniMoGen: one diffusion model for many bodies."""
