"""The spatial-audio reaction model after MOSPA (Xu et al. 2025): features of two ears, simulated data, the diffusion transformer, its table."""
