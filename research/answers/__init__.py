"""How right and how sure answers are, from known truths and independent data: each runs by hand."""
