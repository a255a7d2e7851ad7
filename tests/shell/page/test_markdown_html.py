"""Markdown of the documentation as HTML."""

from __future__ import annotations

import pytest

from rosbridge_sim.shell.page.markdown_html import render_markdown

PAGES = frozenset(["index", "operation", "guides/ci", "guides/page"])
IMAGES = frozenset(["images/town.png"])


def render(text: str, name: str = "guides/ci") -> str:
    return render_markdown(text, name, PAGES, IMAGES)


@pytest.mark.parametrize("text", ["<script>x()</script>", "a <b onclick=x()>b</b>", "<!-- c -->", "| <i> |\n|---|"])
def test_html_of_a_text_is_shown_as_it_is_written(text: str) -> None:
    html = render(text)
    assert "&lt;" in html
    assert not any(sign in html for sign in ("<script", "<b", "<!--", "<i>"))


def test_marks_for_the_tests_are_not_shown() -> None:
    assert render("a\n\n<!-- run: first -->\n```python\nx\n```\n") == render("a\n\n```python\nx\n```\n")


@pytest.mark.parametrize(
    ("href", "target"),
    [
        ("page.md", "page"),
        ("../operation.md#health", "../operation#health"),
        ("../index.md", "../index"),
        ("page.md?x", None),
        ("nothing.md", None),
        ("../../README.md", None),
        ("../../rosbridge_sim/version.py", None),
        ("/etc/passwd", None),
        ("javascript:alert(1)", None),
        ("data:text/html,x", None),
        ("//example.org/x.md", None),
        ("#below", "#below"),
        ("https://example.org/", "https://example.org/"),
        ("../images/town.png", "../images/town.png"),
    ],
)
def test_links_lead_to_what_the_server_has_and_others_are_text(href: str, target: str | None) -> None:
    html = render(f"see [the *text*]({href}) there")
    if target is None:
        assert "<a" not in html
        assert "the <em>text</em>" in html or "[the <em>text</em>]" in html
    else:
        assert f'<a href="{target}">the <em>text</em></a>' in html


def test_picture_of_the_package_is_shown_and_others_are_their_text() -> None:
    assert '<img src="../images/town.png" alt="A town">' in render("![A town](../images/town.png)").replace(" />", ">")
    for src in ("https://example.org/a.png", "../images/no.png", "../../x.png"):
        assert render(f"![A town]({src})") == "<p>A town</p>\n"


def test_headings_have_anchors_of_their_own() -> None:
    html = render("# What `a_b` is\n\n## Notes\n\n## Notes\n")
    for anchor in ("what-a_b-is", "notes", "notes-1"):
        assert html.count(f'id="{anchor}"') == html.count(f'href="#{anchor}"') == 1


def test_table_has_classes_and_no_styles() -> None:
    html = render("| a | b |\n|---|--:|\n| 1 | 2 |\n")
    assert html.startswith('<div class="table"><table>')
    assert '<td class="right">2</td>' in html
    assert "style" not in html


def test_place_for_the_python_reference_says_how_to_read_it() -> None:
    html = render("Before.\n\n::: rosbridge_sim.client.Client\n    options:\n      members: [a]\n\nAfter.\n")
    assert "<code>python -m pydoc rosbridge_sim.client.Client</code>" in html
    assert "options" not in html
    assert "<p>After.</p>" in html
