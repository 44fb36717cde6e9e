"""Tables that can be read on a narrow screen: each cell knows the heading of its column.

On such a screen `site.css` puts the cells of a row below each other, and this heading before each of them.
"""

import re

from bs4 import BeautifulSoup

_TABLE = re.compile(r"<table class=\"docutils.*?</table>", re.DOTALL)


def label_cells(html):
    """The same page, with the headings of the columns at the cells of each table."""
    return _TABLE.sub(lambda found: _labelled(found[0]), html)


def _labelled(text):
    soup = BeautifulSoup(text, "html.parser")
    table = soup.table
    heads = [cell.get_text(" ", strip=True) for cell in table.select("thead th")]
    if len(heads) > 2:
        table["class"] = [*table["class"], "labelled"]
        for row in table.select("tbody tr"):
            for head, cell in zip(heads, row.find_all("td"), strict=False):
                cell["data-label"] = head
    return str(soup)


def _on_page(app, pagename, templatename, context, doctree):
    if "<table" in context.get("body", ""):
        context["body"] = label_cells(context["body"])


def setup(app):
    app.connect("html-page-context", _on_page, priority=900)
    return {"parallel_read_safe": True}
