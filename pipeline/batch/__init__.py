"""Many recordings: each a run of its own, on local workers or a cluster, one failing stopping nothing."""
