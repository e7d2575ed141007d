"""The field's habit: Plackett-Burman screening, steepest ascent, a response surface, its optimum, a check."""
