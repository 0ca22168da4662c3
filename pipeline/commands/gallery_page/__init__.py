"""The page of the gallery of effects."""
