"""The diagnosis of left-out physics: its report, and the inspection corrected for the effects found."""
