"""From parameters, targets and runs to an answer: designs, surrogates, search, strategies, uncertainty."""
