"""The blind benchmark of the diagnosis: hidden systems, baselines, scores (docs/blind.md)."""
