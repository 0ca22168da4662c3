"""What a field recording says of left-out physics: pipe, poses and wall unknown, rings against texture."""
