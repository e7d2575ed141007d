"""What is not the main chain: studies of its noise, its certainty and its parts."""
