"""Training loops: audio encoder, VAE, flow, student."""
