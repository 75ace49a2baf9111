"""Tables of a page, as text."""

import re


def first_table(html):
    """The rows of the first table in HTML, each a list of its cells' texts."""
    rows = re.findall("<tr.*?</tr>", html.split("</table>")[0], flags=re.S)
    cells = [re.findall("<t[hd][^>]*>(.*?)</t[hd]>", row, flags=re.S) for row in rows]
    return [[re.sub("<.*?>", "", cell) for cell in row] for row in cells]
