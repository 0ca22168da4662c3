"""A page that compares boresight with alternative programs, made by one command."""
