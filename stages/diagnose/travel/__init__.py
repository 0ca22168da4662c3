"""Motion against encoder: scale, slips, play and delay, as far as the motion determines each."""
