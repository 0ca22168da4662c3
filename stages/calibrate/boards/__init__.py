"""Camera calibration from images of chessboard and ChArUco boards."""
