"""What a reader sees: pictures, films, pages, figures."""
