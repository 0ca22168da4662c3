"""The review's local web server: loopback only, one token, nothing from anywhere else."""
