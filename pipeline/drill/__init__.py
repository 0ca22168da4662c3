"""Diagnose recordings with concealed effects, and compare the answers with what was concealed."""
