"""What people look at: the report and the review server."""
