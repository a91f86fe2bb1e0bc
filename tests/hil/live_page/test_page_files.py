from __future__ import annotations

import re

from hil.live_page.page_files import START, headers, page_files

FILES = page_files()


def test_a_browser_asks_for_nothing_that_is_not_shipped() -> None:
    asked = {START}
    for kind, content in FILES.values():
        text = content.decode()
        assert kind.endswith("; charset=utf-8")
        assert not re.findall(r"""https?://(?!\$)""", text)
        asked |= set(re.findall(r"""(?:src|href|from)=?\s*"(?:\./)?([a-z.]+\.(?:js|css))\"""", text))
    assert asked == FILES.keys()


def test_the_page_keeps_to_its_policy_which_lets_nothing_in_line() -> None:
    text = FILES[START][1].decode()
    assert not re.search(r"<script(?![^>]*\bsrc=)|<style|\sstyle=|\son[a-z]+=", text)
    policy = headers("127.0.0.1:7480")["Content-Security-Policy"]
    assert "unsafe" not in policy
    assert "default-src 'none'" in policy
    assert "frame-ancestors 'none'" in policy


def test_what_the_lab_says_is_never_taken_for_markup() -> None:
    for name, (_, content) in FILES.items():
        if name.endswith(".js"):
            assert not re.search(
                r"innerHTML|insertAdjacentHTML|document\.write|\beval\(|new Function", content.decode()
            )


def test_every_element_that_the_script_looks_for_is_there() -> None:
    ids = set(re.findall(r'\bid="([a-z-]+)"', FILES[START][1].decode()))
    wanted = set(re.findall(r'\$\("([a-z-]+)"\)', FILES["page.js"][1].decode()))
    assert wanted <= ids
