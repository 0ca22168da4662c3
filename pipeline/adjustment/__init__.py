"""Least squares: normal equations (banded, bordered), elimination with covariance, robust losses."""
