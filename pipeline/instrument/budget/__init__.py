"""Error budget of the ring scanner: the paper's Table I and more, analytic and by Monte Carlo.

`combine.error_budget` gives the rows and their sum for a `scan.RingScan`; `scan.radius_covariance` is the
radius' covariance from the probe's uncertainty alone; `design` answers the designer's questions.
"""
