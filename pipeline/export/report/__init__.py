"""report.html: one page that tells a whole run and opens offline."""
