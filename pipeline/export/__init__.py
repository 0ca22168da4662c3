"""Writers of a run folder's files: one artefact in, finished files out."""
