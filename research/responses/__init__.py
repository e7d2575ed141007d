"""What to measure next: further responses of the pile, other bench tests, direct tests of a parameter."""
