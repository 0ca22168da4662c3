"""The nouns of boresight and the machine that runs its stages."""
