"""An inspector's decisions on the findings of a run: actions, their ledger, and what they amount to."""
