"""Checks a report page: every element closes, nothing is fetched, every id is unique, no template tag is left, and the
given texts occur.

check_page.py report.html [text ...]
"""
import base64
import html
import html.parser
import re
import sys

VOID = {"meta", "img", "input", "link", "br", "hr"}
SELF_CLOSING = {"rect", "path"}  # of SVG


class Checker(html.parser.HTMLParser):
    def __init__(self):
        super().__init__()
        self.open, self.ids, self.pictures, self.policy = [], set(), 0, False

    def attributes(self, tag, attributes):
        for name, value in attributes:
            if name in ("src", "href", "data", "action", "poster", "srcset", "xlink:href"):
                assert re.match(r"data:image/(png|jpeg);base64,", value), f"<{tag}> fetches {value[:60]}"
                base64.b64decode(value.split(",", 1)[1], validate=True)
                self.pictures += 1
            if name == "id":
                assert value not in self.ids, f"id {value} occurs twice"
                self.ids.add(value)
            assert name != "style" or "url(" not in value
        self.policy |= tag == "meta" and "default-src 'none'" in (dict(attributes).get("content") or "")

    def handle_starttag(self, tag, attributes):
        self.attributes(tag, attributes)
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        assert tag in SELF_CLOSING | VOID, f"<{tag}/>"
        self.attributes(tag, attributes)

    def handle_endtag(self, tag):
        assert self.open and self.open[-1] == tag, f"</{tag}> closes {self.open[-1:]} at {self.getpos()}"
        self.open.pop()


with open(sys.argv[1], encoding="utf-8") as stream:
    page = stream.read()
checker = Checker()
checker.feed(page)
checker.close()
assert not checker.open, f"never closed: {checker.open}"
assert checker.policy, "no content security policy"
assert checker.pictures >= 1
without_pictures = re.sub(r"base64,[A-Za-z0-9+/=]*", "", page)
assert "{{" not in without_pictures and "}}" not in re.sub(r"}\s*}", "", without_pictures)
assert not re.search(r"https?://|@import|url\(|<link|<iframe|fetch\(|XMLHttpRequest", without_pictures)
for text in sys.argv[2:]:
    assert text in without_pictures, f"'{text}' is not on the page"
assert html.unescape(page) is not None
