"""What each part of the method is worth: the parts beside their alternatives, at equal budgets."""
