"""The next measurement: further responses of the pile, other bench tests, direct tests of a parameter."""
