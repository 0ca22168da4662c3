"""Motion against encoder: scale, slips, play and delay, each as far as the motion determines it."""
