"""Fisheye-native camera models behind one interface."""
