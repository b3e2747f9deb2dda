"""Who gets into the studio: the browser that it starts, one whose user types the code, and no other."""

import asyncio
import json
import re
import socket
from contextlib import ExitStack
from importlib import resources
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from end_to_end.studios import closed, conversation, status, studio
from headless import browser as start
from selenium.webdriver.common.keys import Keys

from gen_profile.presentation.studio.entrance import GO_ON
from gen_profile.presentation.studio.state import StudioState

BROWSER = """#!/bin/sh
tr '\\0' '\\n' < /proc/$$/cmdline > {seen}.part
mv {seen}.part {seen}
"""
BEYOND = 1100  # connections: more than the files that a process may usually open


@pytest.fixture
def browser(tmp_path):
    """Put a browser in place of the user's, which writes down its command line."""
    program = tmp_path / "browser"
    program.write_text(BROWSER.format(seen=tmp_path / "seen"))
    program.chmod(0o700)
    return program


@pytest.fixture(scope="module")
def chromium():
    with start() as window:
        yield window


@pytest.fixture
def window(chromium):
    """Give a window that no studio has let in."""
    chromium.visit("about:blank")
    chromium.driver.execute_cdp_cmd("Network.clearBrowserCookies", {})
    chromium.complaints()
    return chromium


def command_lines():
    """Read what every local user can."""
    found = []
    for entry in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            found.append(entry.read_bytes().decode(errors="replace"))
        except OSError:
            continue
    return found


def opened_file(seen):
    """Wait until the browser is started, and give the file that it is to open, and all command lines."""
    lines = set()
    while not seen.exists():
        lines.update(command_lines())
    return Path(unquote(urlsplit(seen.read_text().split()[-1]).path)), "\n".join([*lines, seen.read_text()])


def test_no_page_lets_a_browser_ask_for_an_icon():
    assets = resources.files("gen_profile.presentation.studio") / "assets"
    for page in (GO_ON, *((assets / name).read_text("utf-8") for name in ("code.html", "studio.html"))):
        assert '<link rel="icon" href="data:,">' in page


@pytest.mark.slow
def test_no_command_line_holds_what_lets_a_browser_in(browser, tmp_path):
    with studio(browser=browser) as running:
        page, lines = opened_file(tmp_path / "seen")
        assert page.stat().st_mode & 0o777 == 0o600 and page.parent.stat().st_mode & 0o777 == 0o700
        (key,) = re.findall(r'value="([\w-]{40,})"', page.read_text())
        assert page.name in lines
        cookie = running.enter(key, Origin="null")
        assert cookie and running.enter(key, Origin="null") == ""  # once
        value = cookie.partition(";")[0].partition("=")[2]
        assert value == running.cookie.partition("=")[2]  # the code still works
        assert not any(word in lines for word in (key, value, running.code))
        words = set(re.findall(r"[\w-]{8,}", lines))
        assert not words & {key, value, running.code}
    assert not page.parent.exists()


@pytest.mark.slow
def test_the_browser_that_is_started_shows_the_page_at_an_address_without_a_key(browser, window, tmp_path):
    with studio(browser=browser) as running:
        page, _ = opened_file(tmp_path / "seen")
        window.visit(page.as_uri())
        window.wait("return document.querySelector('#pill.passed') !== null")
        assert window.run("return location.href") == running.address
        assert window.run("return document.cookie") == ""
        assert window.complaints() == []
        window.visit(page.as_uri())  # again: the key is used, but this browser has its cookie
        window.wait("return document.querySelector('#pill.passed') !== null")
        window.driver.delete_all_cookies()
        window.visit(page.as_uri())
        window.wait("return document.querySelector('.code input') !== null")


@pytest.mark.slow
def test_a_link_holds_the_state_alone_and_a_stranger_needs_the_code(window):
    state = StudioState(edits={"move.duration": 3.3})
    with studio() as running:
        window.visit(f"{running.address}#{state.address}")
        assert "3.3" not in window.find("body").text
        field = window.find("input[name=word]")
        assert field == window.driver.switch_to.active_element
        field.send_keys("aaaa-aaaa\n")
        window.wait("return document.querySelector('.code [role=alert]:not([hidden])') !== null")
        window.find("input[name=word]").send_keys(f"{running.code}\n")
        window.wait("return document.querySelector('#command')?.textContent.endsWith('move.duration=3.3')")
        assert window.run("return location.href") == f"{running.address}#{state.address}"
        assert [one for one in window.complaints() if "403" not in one] == []


@pytest.mark.slow
def test_a_page_goes_on_when_the_studio_is_there_again(window):
    with studio() as running:
        running.open(window)
        window.wait("return document.querySelector('#pill.passed') !== null")
        field = window.find('input[type=number][aria-label="Duration"]')
        field.send_keys(Keys.CONTROL, "a", Keys.NULL, "3.2\n")
        window.wait("return document.querySelector('#pill.passed') !== null && location.hash !== ''")
        port = urlsplit(running.address).port
    window.wait("return document.querySelector('#notice').textContent.includes('was closed')")
    with studio("--port", str(port)) as running:
        window.wait("return document.querySelector('#notice').textContent.includes('type the code')")
        page = window.driver.current_window_handle
        window.driver.switch_to.new_window("tab")
        running.open(window)
        window.driver.switch_to.window(page)
        window.wait("return document.querySelector('#notice').hidden")
        field.send_keys(Keys.CONTROL, "a", Keys.NULL, "3.3\n")
        window.wait("return document.querySelector('#answer').textContent !== 'Solving …'")
        window.wait("return document.querySelector('#pill.passed') !== null")
        window.wait("return document.querySelector('#command').textContent.includes('=3.3')")
        boxes = window.run("return [...document.querySelectorAll('#formats input')].map((box) => box.value)")
        assert len(boxes) == len(set(boxes))


def half_sent(address):
    """Begin requests of some kinds that never end."""
    yield b""
    yield b"GET / HTTP/1.1\r\nHost: "
    yield f"POST / HTTP/1.1\r\nHost: {address}\r\nContent-Length: 9\r\n\r\nword=".encode()


def until_closed(connection):
    """Wait until the other end closes a connection."""
    while connection.recv(65_536):
        pass


@pytest.mark.slow
def test_strangers_who_hold_connections_keep_no_user_out(tmp_path):
    with (tmp_path / "told").open("w+") as stderr, studio(stderr=stderr) as running, ExitStack() as held:
        place, begun = urlsplit(running.address), [*half_sent(urlsplit(running.address).netloc)]
        cookie = running.cookie
        for index in range(BEYOND):
            stranger = held.enter_context(socket.create_connection((place.hostname, place.port)))
            try:
                stranger.sendall(begun[index % len(begun)])
                if index % 100 == 0:
                    assert status(running.address, Cookie=cookie) == 200
            except ConnectionError:  # its place was given to another one
                continue
        assert len([*Path(f"/proc/{running.pid}/fd").iterdir()]) < 200
        heard = conversation(running, {"say": "open", "address": ""}, until="state")
        assert heard["hello"]["start"]
        stderr.seek(0)
        assert len(stderr.read().splitlines()) == 1  # another code


@pytest.mark.slow
def test_a_request_that_is_not_sent_ends_and_a_conversation_stays():
    with studio() as running:
        place = urlsplit(running.address)

        async def talk():
            page = await running.connect()
            with ExitStack() as held:
                strangers = []
                for begun in half_sent(place.netloc):
                    strangers.append(socket.create_connection((place.hostname, place.port)))
                    held.enter_context(strangers[-1]).sendall(begun)
                await asyncio.gather(*(asyncio.to_thread(until_closed, one) for one in strangers))
            await page.write_message('{"say": "open", "address": ""}')
            while json.loads(await page.read_message())["part"] != "state":
                pass
            await closed(page)

        asyncio.run(talk())
