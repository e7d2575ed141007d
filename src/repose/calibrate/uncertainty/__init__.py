"""How far the data determine the parameters: posterior, sensitivity, noise."""
