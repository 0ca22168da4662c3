"""Least squares for motion, calibration and diagnosis, which supply residuals and derivatives.

``bordered``: normal equations of frames (a block band), of landmarks and of a border of global unknowns,
with marginal covariances; its compiled sums are in ``elimination``. ``normal_equations``: dense ones with
marginalisation by the Schur complement, and the factor of banded ones. ``robust``: robust losses and spreads,
and the covariance of equations whose errors are correlated (sandwich estimator). ``motion_priors``: smooth
motion and slow drift. ``levenberg_marquardt``: the iteration to the minimum.

Why not a library: gtsam 4.3.0 and pyceres 2.6 have wheels, scikit-sparse has none for this Python. On 400
frames, 2,000 landmarks and 20,000 observations of two coordinates (one core, Jacobians known beforehand),
one solution of the linear equations took 0.04 s here; 0.20 s with gtsam, 0.14 s of it to hand over its
factors one by one; and 0.47 s for an iteration of pyceres, which calls Python for each observation. Terms
of this program are arrays of many observations, so that the hand-over costs more than the algebra, and it
cannot be avoided without writing the terms in C++. Neither library gives cluster-robust covariances, and the
response of all frames to a few of the global unknowns, which submaps and diagnosis need, would have to be
written on top of either. gtsam would also add 110 MB to the installation.
"""
