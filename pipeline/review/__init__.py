"""The review server and its reports."""
