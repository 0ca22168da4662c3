"""What an inspector takes away: report as PDF and HTML, tables, pictures; one set of numbers for all."""
