"""Evidence of left-out physics in an inspection: rings against texture, with pipe, poses, wall unknown."""
