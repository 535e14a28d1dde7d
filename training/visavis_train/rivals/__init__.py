"""Ablations of the flow model and rivals of it, small, trained alike and brought into the evaluation's windows."""
