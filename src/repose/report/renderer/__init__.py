"""Draw shaded pictures and films of grains and walls, without a screen."""
