"""Hearing: sounds in the room as one more modality of the flow model (after MOSPA, causal)."""
