"""The built site in a browser: `make site-test` builds it and runs this.

Every page is opened from its folder, without a network, at the width of a telephone and of a desk.
"""

from __future__ import annotations

import os
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from browser import CHROMIUM, Browser

SITE = Path(os.environ.get("TENSEGRITY_SITE", Path(__file__).parent.parent / "docs/_build/site"))
PAGES = sorted(
    str(path.relative_to(SITE))
    for path in SITE.glob("**/*.html")
    if path.relative_to(SITE).parts[0] != "_static"  # templates of the theme
)
ADDRESSES = {"a": "href", "link": "href", "img": "src", "script": "src", "source": "src"}
WIDTHS = (400, 1400)

pytestmark = pytest.mark.skipif(not PAGES, reason="the site is not built: run `make site-test`")

LOOK = """(async () => {
  const images = [...document.images];
  images.forEach(image => image.loading = "eager");
  await Promise.all(images.map(image => image.decode().catch(() => null)));
  const page = document.documentElement;
  const wide = [...document.querySelectorAll("body *")].filter(e =>
    e.getBoundingClientRect().right > page.clientWidth + 1).slice(0, 3);
  return {
    missing: images.filter(image => !image.naturalWidth).map(image => image.src),
    nameless: images.filter(image => !image.hasAttribute("alt")).map(image => image.src),
    over: page.scrollWidth - page.clientWidth,
    wide: wide.map(e => e.tagName + "." + e.className),
    title: document.title,
  };
})()"""


class Reader(HTMLParser):
    """The addresses that a page uses and the places that it can be entered at."""

    def __init__(self, path):
        super().__init__()
        self.used, self.places = [], set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        attrs = dict(attrs)
        if attrs.get("id"):
            self.places.add(attrs["id"])
        address = attrs.get(ADDRESSES.get(tag, ""))
        if address is not None:
            self.used.append((tag, address))


@pytest.fixture(scope="module")
def read():
    return {page: Reader(SITE / page) for page in PAGES}


@pytest.fixture(scope="module")
def browser():
    if CHROMIUM is None:
        pytest.skip("no Chromium here: install Debian's package chromium")
    with Browser() as found:
        yield found


def broken(page, address, read):
    """What is wrong with an address that a page uses, or ""."""
    parts = urlsplit(address)
    if parts.scheme in ("mailto", "data"):
        return ""
    target = (SITE / page).parent / unquote(parts.path) if parts.path else SITE / page
    target = Path(os.path.normpath(target))
    if not target.is_file():
        return f"{page}: {address} is not there"
    name = os.path.relpath(target, SITE)
    if parts.fragment and name in read and unquote(parts.fragment) not in read[name].places:
        return f"{page}: {address} leads to no such place"
    return ""


def test_every_link_leads_somewhere_and_nothing_is_fetched(read):
    wrong, fetched = [], []
    for page, reader in read.items():
        for tag, address in reader.used:
            if urlsplit(address).scheme in ("http", "https") or address.startswith("//"):
                fetched += [(page, address)] if tag != "a" else []
            else:
                wrong.append(broken(page, address, read))
    assert not list(filter(None, wrong))
    assert not fetched


def test_a_broken_link_is_noticed(read):
    assert "is not there" in broken("index.html", "guide/no-such-page.html", read)
    assert "no such place" in broken("index.html", "claims.html#no-such-claim", read)
    assert broken("index.html", "claims.html#width-slow", read) == ""


def test_every_job_of_the_guide_and_every_part_is_there():
    parts = [
        "index",
        "claims",
        "derivations",
        "limits",
        "speed",
        "house",
        "extend",
        "cite",
        "guide/curve",
    ]
    parts += ["gallery/index", "reference/index", "reference/granular"]
    assert {f"{part}.html" for part in parts} <= set(PAGES)


def test_pages_show_what_their_code_prints_and_copy_the_code_alone(browser):
    browser.resize(1400)
    browser.open((SITE / "guide/wave.html").as_uri())
    blocks, outputs, buttons = browser.evaluate(
        """["div.highlight-python", "div.output", "button.copybtn"].map(
          s => document.querySelectorAll(s).length)"""
    )
    assert blocks == buttons >= 2
    assert outputs >= 2


def test_the_reference_leads_to_sources_and_shows_examples():
    texts = [path.read_text(encoding="utf-8") for path in SITE.glob("reference/*.html")]
    assert sum(text.count('class="viewcode-link"') for text in texts) > 150
    assert sum(text.count('class="rubric">Examples') for text in texts) >= 30


@pytest.mark.parametrize(
    "words", ["buckling", "intruder", "notebook", "tutorial", "band gap", "calibration", "damping",
              "animation"],
)  # fmt: skip
def test_what_a_visitor_searches_finds_a_page(browser, words):
    browser.resize(1400)
    browser.open(f"{(SITE / 'search.html').as_uri()}?q={words.replace(' ', '+')}")
    found = browser.evaluate(
        """new Promise(done => { const look = n => {
          const found = document.querySelectorAll("#search-results li").length;
          found || n > 50 ? done(found) : setTimeout(look, 100, n + 1) }; look(0) })"""
    )
    assert found > 0


@pytest.mark.parametrize("width", WIDTHS)
def test_every_page_shows_itself_whole_without_complaint(browser, width):
    browser.resize(width)
    found = {}
    for page in PAGES:
        browser.open((SITE / page).as_uri())
        seen = browser.evaluate(LOOK)
        wrong = browser.complaints + seen["missing"] + seen["nameless"]
        if seen["over"] > 0:
            wrong.append(f"wider than the view by {seen['over']} px: {seen['wide']}")
        if wrong or not seen["title"]:
            found[page] = wrong
    assert not found


def test_the_page_s_faults_are_noticed(browser, tmp_path):
    bad = tmp_path / "bad.html"
    bad.write_text(
        "<title>bad</title><img src='none.png' alt=''><p style='width: 3000px'>wide</p>"
        "<script>console.error('no'); lost()</script>"
    )
    browser.resize(400)
    browser.open(bad.as_uri())
    seen = browser.evaluate(LOOK)
    assert seen["missing"]
    assert seen["over"] > 2000
    assert len(browser.complaints) >= 2


@pytest.mark.parametrize("dark", [False, True])
def test_text_stands_out_from_the_page_in_light_and_dark(browser, dark):
    browser.resize(1400, dark=dark)
    browser.open((SITE / "claims.html").as_uri())
    light = browser.evaluate(
        """["body", ".bd-article p"].map(s => { const style = getComputedStyle(
          document.querySelector(s)); return s == "body" ? style.backgroundColor : style.color })
          .map(c => c.match(/[0-9.]+/g).slice(0, 3).reduce((a, b) => a + Number(b), 0) / 765)"""
    )
    paper, ink = light
    assert (paper < 0.3 and ink > 0.7) if dark else (paper > 0.9 and ink < 0.4)


def test_every_formula_of_the_derivations_is_rendered(browser):
    browser.resize(1400)
    browser.open((SITE / "derivations.html").as_uri())
    count, bad = browser.evaluate(
        """(() => { const all = [...document.querySelectorAll("math")];
          return [all.length, all.filter(m => { const box = m.getBoundingClientRect();
            return box.width < 3 || box.height < 5 || m.querySelector("merror") }).length] })()"""
    )
    assert count > 150
    assert bad == 0
