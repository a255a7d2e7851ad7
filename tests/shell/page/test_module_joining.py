"""Modules joined into one script."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path

import pytest

from rosbridge_sim.shell.page.module_joining import JoinError, join_modules
from rosbridge_sim.shell.page.web_page import PATHS
from tests.support import PATIENCE, ROOT, require_tool

PAGE = ROOT / "rosbridge_sim" / "page"


def join(**modules: str) -> str:
    """Join modules by name, from `main` on."""
    files = {f"js/{name}.js": text for name, text in modules.items()} | {"data.json": '{"a": [1, "é"]}'}
    return join_modules("js/main.js", files.__getitem__)


def refuse(**modules: str) -> str:
    with pytest.raises(JoinError) as caught:
        join(**modules)
    return str(caught.value)


def test_module_stands_behind_those_that_it_imports_and_only_once() -> None:
    text = join(
        main='import { a } from "./a.js";\nimport {\n  b,\n} from "./b.js";\na(b);\n',
        a='import { b } from "./b.js";\nexport function a() { return b; }\n',
        b="export const b = 1;\n",
    )
    assert text.split("// js/")[1:] == [
        "b.js\nconst b = 1;\n\n",
        "a.js\nfunction a() { return b; }\n\n",
        "main.js\na(b);\n",
    ]


def test_json_file_becomes_a_constant() -> None:
    line = 'import colours from "../data.json" with { type: "json" };\n'
    text = join(
        main=f'{line}import {{ x }} from "./x.js";\nx(colours);\n', x=f"{line}export const x = () => colours;\n"
    )
    assert text.count('const colours = {"a":[1,"\\u00e9"]};') == 1


def test_words_in_comments_and_texts_are_no_code() -> None:
    body = (
        '/** import("./x.js").Y\nexport default */\nconst a = `\nexport {\nimport x\nconst a = 2;`; // export * from\n'
    )
    assert body.strip() in join(main=body)


def test_module_that_is_loaded_late_stays_apart_and_its_place_is_checked() -> None:
    text = join(main='export async function f() {\n  return (await import("./late.js")).g;\n}\n')
    assert 'import("./late.js")' in text
    late = 'export const f = () => import("./late.js");\n'
    assert "js/deep/x.js:1" in refuse(**{"main": 'import { f } from "./deep/x.js";\nf();\n', "deep/x": late})


@pytest.mark.parametrize(
    ("text", "where", "got"),
    [
        ('\nimport a from "./a.js";', "js/main.js:2", "import a from"),
        ('import * as a from "./a.js";', "js/main.js:1", "import * as"),
        ('import { a as b } from "./a.js";', "js/main.js:1", "import { a as b }"),
        ('import "./a.js";', "js/main.js:1", "import"),
        ('import { a } from "library.js";', "js/main.js:1", "'library.js'"),
        ('import { c } from "./a.js";', "js/main.js:1", "'c'"),
        ("\n\nexport default 1;", "js/main.js:3", "export default 1;"),
        ("const x = 1;\nexport { x };", "js/main.js:2", "export { x };"),
        ('export * from "./a.js";', "js/main.js:1", "export * from"),
        ("export let x = 1;", "js/main.js:1", "export let x = 1;"),
        ('\nconst x = import("./b/a.js");', "js/main.js:2", 'import("./x.js")'),
        ("const x = import(`./a.js`);", "js/main.js:1", 'import("./x.js")'),
        ("const x = import.meta.url;", "js/main.js:1", "import.meta"),
        ("const { x } = y;", "js/main.js:1", "const { x } = y;"),
        ("await x();", "js/main.js:1", "await x();"),
        ('import { a } from "./a.js";\nconst b = 1;', "js/main.js:2", "'b' is also in js/a.js:2"),
        ("const x = 1;\n\nfunction x() {}", "js/main.js:3", "'x' is also in js/main.js:1"),
    ],
)
def test_other_forms_are_refused_with_file_and_line(text: str, where: str, got: str) -> None:
    message = refuse(main=text, a="export const a = 1;\nconst b = 2;\n")
    assert message.startswith(f"{where}: expected ")
    assert got in message


def test_modules_in_a_circle_are_refused() -> None:
    message = refuse(
        main='import { a } from "./a.js";\n',
        a='import { b } from "./b.js";\nexport const a = 1;\n',
        b='\nimport { a } from "./a.js";\nexport const b = 1;\n',
    )
    assert message.startswith("js/b.js:2: ")
    assert message.endswith("js/a.js -> js/b.js -> js/a.js")


def test_json_file_has_one_name() -> None:
    message = refuse(
        main='import a from "../data.json" with { type: "json" };\nimport { x } from "./x.js";\n',
        x='import b from "../data.json" with { type: "json" };\nexport const x = b;\n',
    )
    assert "expected the name that other modules have for data.json; got 'b'" in message


def joined_modules(text: str) -> list[Path]:
    """The modules of the page but those that it loads late; these must be served."""
    late = {f"js/{name}" for name in re.findall(r'await import\("\./(\w+\.js)"\)', text)}
    assert late <= {name for name, _ in PATHS.values()}
    return sorted({*PAGE.glob("js/**/*.js")} - {PAGE / name for name in late})


def test_joined_page_has_each_module_of_the_page() -> None:
    text = join_modules("js/main.js", lambda path: (PAGE / path).read_text("utf-8"))
    for path in joined_modules(text):
        assert f"// {path.relative_to(PAGE).as_posix()}\n" in text, f"{path} is imported by no module of the page"


@pytest.mark.slow
@pytest.mark.client
def test_joined_page_is_one_script_and_declares_what_its_modules_export(tmp_path: Path) -> None:
    text = join_modules("js/main.js", lambda path: (PAGE / path).read_text("utf-8"))
    head, _, main = text.rpartition("// js/main.js\n")  # which needs a browser
    exports = re.compile(r"^export (?:async )?(?:function\*?|class|const) (\w+)", re.MULTILINE)
    names = [name for path in joined_modules(text) for name in exports.findall(path.read_text("utf-8"))]
    kinds = ", ".join(f"typeof {name}" for name in names)
    script = tmp_path / "page.mjs"
    script.write_text(f"{head}\nfunction main() {{\n{main}\n}}\nconsole.log(JSON.stringify([{kinds}]));")
    done = subprocess.run(
        [require_tool("node"), str(script)], capture_output=True, text=True, timeout=PATIENCE, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "undefined" not in json.loads(done.stdout)
