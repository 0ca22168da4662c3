"""The public face: what `import boresight` offers, and what the commands are made of."""
