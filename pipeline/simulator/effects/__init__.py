"""Every effect of the catalogue as a switch: a pure function from one scene's truth to another."""
