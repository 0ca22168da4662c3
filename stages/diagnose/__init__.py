"""Left-out physics: found, named, sized, confirmed."""
