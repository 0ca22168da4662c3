"""What physics was left out: the diagnosis, its report, and the inspection with what was found put in."""
