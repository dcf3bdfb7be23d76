"""The page: self-contained, complete, and rendered by a browser without complaint."""

import re
import subprocess
import sys
from functools import cache
from html.parser import HTMLParser
from pathlib import Path

import pytest
import sympy as sp
from browser import CHROMIUM

from derivations import argument, ledger
from derivations.__main__ import main
from derivations.typeset import latex, mathml

pytestmark = pytest.mark.unchanged()

DERIVATIONS = [  # without the ledger, which is a table, and what writes the page
    path
    for path in Path(argument.__file__).parent.glob("*.py")
    if not path.stem.startswith(("ledger", "report"))
]
VOID = {"meta", "link", "br", "img", "hr"}


@pytest.fixture(scope="module", autouse=True)
def once():
    """Entries and arguments are derived once, for the commands, the page and LaTeX."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ledger, "check", cache(ledger.check))
        for name in argument.NAMES:
            module = argument.derivation(name)
            patch.setattr(module, "argument", cache(lambda made=module.argument: list(made())))
        yield


def test_check_confirms_each_entry_and_then_lists_what_needs_a_reading(capfd, once):
    entries = ledger.entries()
    assert main(["--check"]) == 0
    out, err = capfd.readouterr()
    listed, summary = out.split("\nslip:", 1)
    listed = [line.split() for line in listed.splitlines() if line]
    assert [name for name, *_ in listed] == [entry.name for entry in entries]
    assert not [name for name, verdict, *_ in listed if verdict == "DISAGREES"]
    for entry in entries:
        needs = entry.verdict in (ledger.Verdict.SLIP, ledger.Verdict.CONVENTION)
        assert (f"  {entry.name}: " in summary) == needs
    assert f"{len(entries)} decided, 0 disagree" in summary
    assert err == ""  # no progress bar where there is no terminal


@pytest.fixture(scope="module")
def page(tmp_path_factory, once):
    path = tmp_path_factory.mktemp("page") / "all.html"
    assert main(["--output", str(path)]) == 0
    return path


class _Reader(HTMLParser):
    """Collects tags, addresses, anchors and visible text, and checks that tags close."""

    def __init__(self):
        super().__init__()
        self.open, self.tags, self.addresses, self.anchors = [], [], [], set()
        self.words = []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        for name, value in attrs:
            if name in ("href", "src", "action", "data"):
                self.addresses.append(value)
            if name == "id":
                self.anchors.add(value)
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if "style" not in self.open:
            self.words.append(data)


@pytest.fixture(scope="module")
def read(page):
    reader = _Reader()
    reader.feed(page.read_text(encoding="utf-8"))
    return reader


def test_page_fetches_nothing_and_runs_nothing(read):
    assert read.open == []
    assert "script" not in read.tags
    assert all(a.startswith("#") or a == "data:," for a in read.addresses)


def test_contents_lead_to_every_part(read):
    linked = {a[1:] for a in read.addresses if a.startswith("#")}
    assert set(argument.NAMES) <= linked
    assert linked <= read.anchors


def test_every_entry_is_on_the_page(read):
    assert {entry.name for entry in ledger.entries()} <= read.anchors


def test_no_source_is_visible(read):
    text = " ".join(read.words)
    found = re.findall(
        r"sqrt\(|\*\*|\\frac|<lambda|Derivative|Subs\(|\bpi\b|\bphi\b|subs\(|nan\b|False|True", text
    )
    assert found == []


FORMULAS = [entry.name for entry in ledger.entries() if entry.derive]


@pytest.mark.parametrize("name", [*argument.NAMES, *FORMULAS])
def test_every_derivation_and_formula_of_the_ledger_has_latex(name, capsys):
    assert main([name, "--latex"]) == 0
    text = capsys.readouterr().out
    formulas = re.findall(r"\\\[ (.*?) \\\]", text) if name in argument.NAMES else [text.strip()]
    assert formulas
    for formula in formulas:
        assert not re.search(r"\*\*|Derivative|Subs\(|\bnan\b|zoo|False|True", formula)
        closing, expected = {"{": "}", "(": ")"}, []
        for sign in formula:
            if sign in closing:
                expected.append(closing[sign])
            elif sign in closing.values():
                assert expected.pop() == sign, formula
        assert expected == []
        words = re.sub(r"\\(text|operatorname)\{[^}]*\}|\\[A-Za-z]+|\{[a-z]+\}", "", formula)
        assert not re.search("[a-z]{4}", words), words


def test_names_of_several_parts_are_set_part_by_part():
    front, slope = sp.Symbol("m c_*^2, V(r_*)"), sp.Symbol("Q''(r_*)")
    assert latex(front) == r"m\ c^{2}_{*},\ V(r_{*})"
    assert latex(slope) == r"Q''(r_{*})"
    assert latex(sp.Symbol("change of (g, psi)")) == r"\text{change}\ \text{of}\ (g,\ \psi)"
    assert latex(sp.Symbol("u_1''")) == "u_{1}''"
    at = "<mo>(</mo><msub><mi>r</mi><mi>*</mi></msub><mo>)</mo></mrow></math>"
    assert "<mi>V</mi>" + at in mathml(front)
    assert "<mi>Q''</mi>" + at in mathml(slope)


def test_claims_of_the_ledger_without_formula_are_refused_as_such(capsys):
    claims = {entry.name for entry in ledger.entries()} - set(FORMULAS)
    assert claims
    for name in claims:
        with pytest.raises(SystemExit):
            main([name, "--latex"])
        assert f"'{name}' is a claim of the ledger without formula: " in capsys.readouterr().err


def test_the_latex_of_a_slip_is_its_corrected_form(capsys):
    assert main(["talk.tent_speed", "--latex"]) == 0
    assert capsys.readouterr().out.strip() == r"\text{fast} \wedge c \geq c_{s}"


def test_one_derivation_has_its_own_page_in_the_current_folder(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["junction"]) == 0
    assert "derivation junction" in capsys.readouterr().out
    assert [path.name for path in tmp_path.iterdir()] == ["junction.html"]
    text = (tmp_path / "junction.html").read_text(encoding="utf-8")
    assert 'id="paper.eq7_reflected"' in text
    assert 'id="prism"' not in text


def test_unknown_derivation_is_refused():
    with pytest.raises(SystemExit):
        main(["no-such-thing"])
    with pytest.raises(ValueError, match="no-such-thing"):
        argument.derivation("no-such-thing")


def test_derivations_stay_short():
    assert set(argument.NAMES) <= {path.stem for path in DERIVATIONS}
    for path in DERIVATIONS:
        assert len(path.read_text().splitlines()) <= 240, path.name


PROBE = """<script>
window.addEventListener("load", () => {
  const bad = [...document.querySelectorAll("math")].filter(m => {
    const box = m.getBoundingClientRect();
    return box.width < 3 || box.height < 5 || m.querySelector("merror");
  });
  const parts = [...document.querySelectorAll("math *")].filter(e => e instanceof MathMLElement);
  document.title = "maths " + document.querySelectorAll("math").length + " bad " + bad.length
    + " parts " + parts.length;
});
</script></body>"""


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium here")
def test_browser_renders_every_formula(page, tmp_path):
    """A probe is added to a copy of the page; the page itself has no script."""
    probed = tmp_path / "probed.html"
    text = page.read_text(encoding="utf-8")
    probed.write_text(text.replace("</body>", PROBE), encoding="utf-8")
    flags = [
        "--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking",
        "--disable-component-update", "--disable-sync", "--no-first-run", "--enable-logging=stderr",
        "--v=0", f"--user-data-dir={tmp_path / 'profile'}", "--dump-dom",
    ]  # fmt: skip
    run = subprocess.run(
        [CHROMIUM, *flags, probed.as_uri()], capture_output=True, text=True, timeout=120, check=True
    )
    assert "CONSOLE" not in run.stderr
    formulas = re.findall(r"<math .*?</math>", text, re.DOTALL)
    count, parts = len(formulas), sum(len(re.findall(r"<[a-z]", f)) - 1 for f in formulas)
    assert f"<title>maths {count} bad 0 parts {parts}</title>" in run.stdout
    assert count > 150


def test_command_shows_its_figures(tmp_path):
    run = subprocess.run(
        [sys.executable, "-m", "derivations", "junction", "--output", str(tmp_path / "j.html")],
        capture_output=True, text=True, timeout=120, check=True,
    )  # fmt: skip
    assert run.stdout.strip().endswith(f"entries: {tmp_path / 'j.html'}")
    assert run.stderr == ""
