"""A camera's intrinsic parameters from pictures of a board, and the board to print."""
