"""Rig, motion files, retargeting and the feature representation (numpy only)."""
