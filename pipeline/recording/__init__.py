"""Recordings and the readers that recognise them."""
