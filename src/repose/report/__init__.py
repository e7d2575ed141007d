"""Output for readers: pictures, films, pages, figures."""
