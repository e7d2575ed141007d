"""Accuracy and stated probability of answers, from known truths and independent data; each script runs by hand."""
