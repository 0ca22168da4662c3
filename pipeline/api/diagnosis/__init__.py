"""The diagnosis of left-out physics: its report, and the inspection corrected by what was found."""
