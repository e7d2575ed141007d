"""Studies beside the main chain: of its noise, of its uncertainty and of its parts."""
