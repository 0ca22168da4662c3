"""Registration of one wall on another. There are three methods, for different data.

``by_marks``: two runs of one pipe, whatever their starts, slips and roll: pieces of wall are recognised by
relief and texture, and shift and roll may change along the pipe. It gives the chance of a false match.
``by_radius``: a run on a map of known radius in nearly the same frame: one shift, roll, scale and pose with
the least squared difference of the radius. It needs no texture and few features: on a wall with four dents
and nothing else (``tests/unit/test_verify.py``) its errors are 0.03 mm and 0.03°, where ``by_marks`` refuses
(1 of 20 pieces agree). Certificates use it because it minimises the difference that they state.
``by_points``: a run on a mesh or a cloud in any frame: a rigid pose in space.

On the three open recordings with their true walls, the first two differ by at most 0.13 mm and 0.13°.
"""
