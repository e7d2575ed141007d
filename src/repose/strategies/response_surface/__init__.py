"""The usual way in the field: Plackett-Burman screening, steepest ascent, a response surface, its optimum, a check."""
