"""A plain page of HTML."""

import html

STYLE = """
body { font: 14px/1.4 sans-serif; margin: 1.5em; color: #222; }
table { border-collapse: collapse; }
th, td { padding: 0.25em 0.8em; text-align: right; border-bottom: 1px solid #ddd; }
th { border-bottom: 2px solid #555; }
"""


def page(title: str, body: str, style: str = STYLE) -> str:
    """An HTML page; `title` is plain text, `body` HTML and `style` CSS."""
    head = f'<meta charset="utf-8"><title>{html.escape(title)}</title><style>{style}</style>'
    return f"<!doctype html>\n<html><head>{head}</head>\n<body>{body}</body></html>\n"
