"""A run against a reference: what is compared, how both are brought together, and the figures."""
