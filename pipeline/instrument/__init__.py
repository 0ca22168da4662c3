"""The instrument: camera models, laser surface, probe with its uncertainty, misalignment and budget."""
