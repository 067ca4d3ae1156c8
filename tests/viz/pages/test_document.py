"""Documents: the same content as a page and as Markdown, in files that are whole or absent."""

from pathlib import Path

from viz.pages.document import (
    Document,
    Paragraph,
    Picture,
    Section,
    Table,
    check_folder,
    document_files,
    to_html,
    to_markdown,
)


def test_markdown_has_what_the_page_has() -> None:
    table = Table("A | B", ["name", "value"], [["x|y", "1"], ["z", "2"]])
    picture = Picture("curve", "<svg/>", "a curve")
    document = Document(
        "Title", [Paragraph("First.")], [Section("s", "Heading", [table, picture, Paragraph("!", True)])]
    )
    assert to_markdown(document, "arm-") == (
        "# Title\n\nFirst.\n\n## Heading\n\n**A | B**\n\n| name | value |\n|:--|--:|\n| x\\|y | 1 |\n| z | 2 |\n\n"
        "![a curve](arm-curve.svg)\n\n> !\n"
    )
    assert document.pictures() == [picture]
    page = to_html(document)
    assert "<h2>Heading</h2>" in page
    assert "<td>x|y</td>" in page


def test_files_of_a_document_are_called_by_its_name(tmp_path: Path) -> None:
    document = Document("Title", [Picture("curve", "<svg/>", "a curve")])
    files = document_files(tmp_path, "an arm <3>", document, {"a": 1}, kind="kind")
    assert [*files][-1] == tmp_path / "an_arm_3-kind.html"
    assert {path.name: text for path, text in files.items()} == {
        "an_arm_3-kind.html": to_html(document),
        "an_arm_3-kind.md": to_markdown(document, "an_arm_3-kind-"),
        "an_arm_3-kind.json": '{\n "a": 1\n}',
        "an_arm_3-kind-curve.svg": "<svg/>",
    }


def test_trying_a_folder_leaves_nothing(tmp_path: Path) -> None:
    check_folder(tmp_path / "a" / "b")
    check_folder(tmp_path)
    assert list(tmp_path.iterdir()) == []
