"""DRAM, the dyadic residual-attention model (Ahuja et al. 2019), as the featherweight tier: networks, training, bundle, evaluation."""
