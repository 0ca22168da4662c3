"""The public face: what `import boresight` offers; the command line is built on it."""
