"""The public API: the functions of `import boresight`; the command line is built on it."""
