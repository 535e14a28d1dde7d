"""The conversation corpus: simulated from real parts (see README.md in this folder)."""
