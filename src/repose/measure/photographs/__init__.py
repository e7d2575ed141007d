"""A pile's outline from a photograph; needs OpenCV."""
