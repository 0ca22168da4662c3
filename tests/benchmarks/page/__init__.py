"""The page that holds boresight against what people would use instead, made anew by one command."""
