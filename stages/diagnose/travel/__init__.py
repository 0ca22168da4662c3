"""Motion against encoder: scale, slips, play and delay, each with what the motion lets tell."""
