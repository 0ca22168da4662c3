"""How each known effect changes what is measured; one file for each family."""
